//! The settings in flash: whatever is cut wherever, the old set or the new one
//! is there.

mod device;
mod flash;

use canmaster::sdo::AbortCode;
use canmaster::store::{CAPACITY, Store, StoreError};
use flash::{Flash, PAGE, Torn};
use proptest::prelude::*;

const PAGES: [u32; 2] = [PAGE as u32, 3 * PAGE as u32];

fn open(flash: Flash) -> Store<Flash> {
    Store::new(flash, PAGES).unwrap()
}

fn content(store: &mut Store<Flash>) -> Option<Vec<u8>> {
    let mut buf = [0; CAPACITY];
    store.load(&mut buf).unwrap().map(<[u8]>::to_vec)
}

fn set(n: u32) -> Vec<u8> {
    // Lengths around the word boundaries, and both extremes.
    let lengths = [0, 1, 7, 8, 9, 63, 232, CAPACITY];
    let len = lengths[n as usize % lengths.len()];
    (0..len).map(|i| (i as u32 * 31 + n * 7) as u8).collect()
}

#[test]
fn an_empty_flash_holds_nothing() {
    let mut store = open(Flash::new(1));
    assert_eq!(content(&mut store), None);
}

#[test]
fn the_last_set_is_the_one_that_is_read() {
    let mut store = open(Flash::new(1));
    for n in 0..40 {
        store.save(&set(n)).unwrap();
        assert_eq!(content(&mut store), Some(set(n)));
        // Also after a restart.
        store = open(store.release());
        assert_eq!(content(&mut store), Some(set(n)));
    }
    let flash = store.release();
    // Four records a page: an erase every fourth save.
    assert_eq!(flash.erases(), 10);
    assert!(flash.untouched_outside(&PAGES));
}

#[test]
fn what_is_too_long_is_refused_and_the_old_set_stays() {
    let mut store = open(Flash::new(1));
    store.save(b"old").unwrap();
    let len = CAPACITY + 1;
    assert_eq!(store.save(&vec![0; len]), Err(StoreError::TooLong { len }));
    assert_eq!(content(&mut store), Some(b"old".to_vec()));
    assert_eq!(store.load(&mut [0; 2]), Err(StoreError::Buffer { len: 3 }));
}

#[test]
fn two_pages_of_the_flash_are_needed() {
    for pages in [
        [0, 0],
        [0, 8],
        [0, 1 << 20],
        [u32::MAX - PAGE as u32 + 1, 0],
    ] {
        let store = Store::new(Flash::new(1), pages);
        assert!(matches!(store, Err(StoreError::Pages)), "{pages:?}");
    }
}

#[test]
fn what_a_client_is_told() {
    for (error, code) in [
        (StoreError::Flash, AbortCode::HARDWARE),
        (StoreError::Worn, AbortCode::HARDWARE),
        (StoreError::TooLong { len: 999 }, AbortCode::OUT_OF_MEMORY),
        (StoreError::Pages, AbortCode::CANNOT_STORE),
        (StoreError::Buffer { len: 9 }, AbortCode::CANNOT_STORE),
    ] {
        assert_eq!(AbortCode::from(error), code);
        assert!(!error.to_string().is_empty());
    }
}

/// Saves until the power goes; returns the number of sets that were confirmed.
fn save_until_cut(store: &mut Store<Flash>, first: u32, sets: u32) -> u32 {
    for n in first..first + sets {
        if store.save(&set(n)).is_err() {
            return n - first;
        }
    }
    sets
}

/// Ten saves, three of them with an erase: every operation of all of them is
/// cut, in every way that a cut can end.
#[test]
fn a_cut_at_any_word_or_erase_leaves_the_old_or_the_new_set() {
    const SETS: u32 = 10;
    let mut whole = open(Flash::new(1));
    assert_eq!(save_until_cut(&mut whole, 0, SETS), SETS);
    let operations = whole.release().operations();
    for torn in Torn::ALL {
        for cut in 0..operations {
            let mut store = open(Flash::new(u64::from(cut)).cut_after(cut, torn));
            let done = save_until_cut(&mut store, 0, SETS);
            assert!(done < SETS);
            let mut store = open(store.release().power_on());
            let found = content(&mut store);
            let old = done.checked_sub(1).map(set);
            assert!(
                found == old || found == Some(set(done)),
                "cut at {cut}, {torn:?}: {found:?}"
            );
            // It goes on from there, and never writes a torn word again: the
            // flash model would refuse that.
            for n in 100..106 {
                store.save(&set(n)).unwrap();
                store = open(store.release());
                assert_eq!(content(&mut store), Some(set(n)));
            }
        }
    }
}

proptest! {
    /// Cut after cut after cut, without a save between them that succeeds for
    /// certain.
    #[test]
    fn a_set_survives_any_number_of_cuts(
        seed: u64, cuts in prop::collection::vec((0u32..200, 0..Torn::ALL.len()), 1..20)
    ) {
        let mut flash = Flash::new(seed);
        let mut known: Option<u32> = None;
        let mut next = 0;
        for (after, torn) in cuts {
            let mut store = open(flash.cut_after(after, Torn::ALL[torn]));
            let found = content(&mut store);
            prop_assert_eq!(found, known.map(set));
            let done = save_until_cut(&mut store, next, 8);
            flash = store.release().power_on();
            let mut store = open(flash);
            let found = content(&mut store);
            let before = if done > 0 { Some(next + done - 1) } else { known };
            known = if found == before.map(set) { before } else { Some(next + done) };
            prop_assert_eq!(found, known.map(set));
            next += done + 1;
            flash = store.release();
        }
    }

    /// Whatever stands in the flash at first.
    #[test]
    fn any_content_is_survived(seed: u64) {
        let mut store = open(Flash::new(seed).filled());
        prop_assert_eq!(content(&mut store), None);
        prop_assert_eq!(store.save(b"new"), Ok(()));
        prop_assert_eq!(content(&mut open(store.release())), Some(b"new".to_vec()));
    }
}
