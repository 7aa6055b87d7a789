use super::operation::{ERASE, PROGRAM};
use super::*;

const T0: Time = Time::from_ms(1);
/// An offset in bank 2.
const AT: u32 = BANK_BYTES + 0x800;
const WORD: u64 = 0x0123_4567_89AB_CDEF;

fn flash() -> Flash {
    Flash::new(&FlashOptions::default())
}

fn unlocked(options: &FlashOptions) -> Flash {
    let mut flash = Flash::new(options);
    flash.write(KEYR, KEYS[0], T0);
    flash.write(KEYR, KEYS[1], T0);
    // The data cache off, as the errata sheet wants it.
    flash.write(ACR, ACR_RESET & !ACR_DCEN, T0);
    assert!(flash.take_notes().is_empty());
    flash
}

fn notes(flash: &mut Flash) -> String {
    flash.take_notes().join("; ")
}

fn put(flash: &mut Flash, offset: u32, value: u64, now: Time) {
    flash.write_memory(offset, &(value as u32).to_le_bytes(), now);
    flash.write_memory(offset + 4, &((value >> 32) as u32).to_le_bytes(), now);
}

/// Programs a double word and waits for it.
fn program(flash: &mut Flash, offset: u32, value: u64) {
    flash.write(CR, CR_PG, T0);
    put(flash, offset, value, T0);
    flash.advance(T0 + PROGRAM);
    flash.write(CR, 0, T0);
}

fn page(number: u32, bank2: bool) -> u32 {
    CR_PER | number << CR_PNB_SHIFT | if bank2 { CR_BKER } else { 0 }
}

fn erase(flash: &mut Flash, number: u32, bank2: bool) {
    flash.write(CR, page(number, bank2), T0);
    flash.write(CR, page(number, bank2) | CR_STRT, T0);
    flash.advance(T0 + ERASE);
    flash.write(CR, 0, T0);
}

fn value(flash: &mut Flash, offset: u32) -> u64 {
    let mut bytes = [0; 8];
    assert_eq!(flash.read_memory(offset, &mut bytes), None, "at once");
    u64::from_le_bytes(bytes)
}

fn status(flash: &Flash) -> u32 {
    flash.read(SR).expect("exists")
}

#[test]
fn wait_states_follow_the_table_of_the_reference_manual() {
    let mut flash = flash();
    assert_eq!(flash.check(16_000_000, VoltageRange::Normal), None);
    assert!(flash.check(170_000_000, VoltageRange::Normal).is_some());
    assert!(flash.check(170_000_000, VoltageRange::Boost).is_some());
    for (latency, boost, normal) in [
        (0, 34, 30),
        (1, 68, 60),
        (2, 102, 90),
        (3, 136, 120),
        (4, 170, 150),
    ] {
        assert!(flash.write(ACR, latency, T0));
        assert_eq!(flash.check(boost * 1_000_000, VoltageRange::Boost), None);
        assert_eq!(flash.check(normal * 1_000_000, VoltageRange::Normal), None);
        for (mhz, range) in [(boost, VoltageRange::Boost), (normal, VoltageRange::Normal)] {
            assert!(flash.check(mhz * 1_000_000 + 500_000, range).is_some());
        }
    }
    let on_time = flash.check(170_017_000, VoltageRange::Boost);
    assert_eq!(on_time, None, "+100 ppm is no mistake");
}

#[test]
fn cr_is_locked_until_both_keys_are_given_in_order() {
    let mut flash = flash();
    assert_eq!(flash.read(CR), Some(CR_RESET));
    flash.write(CR, 0, T0);
    assert!(notes(&mut flash).contains("locked"));
    flash.write(KEYR, KEYS[0], T0);
    flash.write(KEYR, KEYS[1], T0);
    assert_eq!(flash.read(CR), Some(CR_RESET & !CR_LOCK));
    flash.write(CR, CR_LOCK, T0);
    assert_eq!(flash.read(CR), Some(CR_RESET), "locked again");
    flash.write(KEYR, KEYS[1], T0);
    assert!(notes(&mut flash).contains("until reset"));
    flash.write(KEYR, KEYS[0], T0);
    flash.write(KEYR, KEYS[1], T0);
    assert_eq!(flash.read(CR), Some(CR_RESET), "locked out");
    flash.reset(T0);
    flash.write(KEYR, KEYS[0], T0);
    flash.write(KEYR, KEYS[1], T0);
    assert_eq!(flash.read(CR), Some(CR_RESET & !CR_LOCK));
}

#[test]
fn a_double_word_takes_82_us_and_a_page_22_ms() {
    let mut flash = unlocked(&FlashOptions::default());
    flash.write(CR, CR_PG | CR_EOPIE, T0);
    flash.write_memory(AT, &(WORD as u32).to_le_bytes(), T0);
    assert_eq!(status(&flash) & SR_BSY, 0, "half a double word");
    flash.write_memory(AT + 4, &((WORD >> 32) as u32).to_le_bytes(), T0);
    assert_eq!(status(&flash), SR_BSY);
    assert_eq!(flash.next_event(), Some(T0 + Time::from_ns(81_690)));
    flash.advance(T0 + Time::from_us(81));
    assert_eq!(status(&flash), SR_BSY);
    assert!(!flash.irq());
    flash.advance(T0 + Time::from_us(82));
    assert_eq!(status(&flash), SR_EOP);
    assert!(flash.irq());
    flash.write(SR, SR_EOP, T0);
    assert!(!flash.irq());
    assert_eq!(value(&mut flash, AT), WORD);

    let start = T0 + Time::from_ms(1);
    flash.write(CR, page(1, true), start);
    flash.write(CR, page(1, true) | CR_STRT, start);
    assert_ne!(flash.read(CR).unwrap_or(0) & CR_STRT, 0);
    flash.advance(start + Time::from_ms(22));
    assert_eq!(status(&flash), SR_BSY);
    flash.advance(start + Time::from_us(22_020));
    assert_eq!(status(&flash), 0, "EOP only with EOPIE");
    assert_eq!(flash.read(CR).unwrap_or(0) & CR_STRT, 0);
    assert_eq!(value(&mut flash, AT), u64::MAX);
    let figures = flash.figures();
    assert_eq!((figures.programmed, figures.erased), (1, 1));
    assert_eq!(notes(&mut flash), "");
}

#[test]
fn an_erase_takes_its_page_and_no_other() {
    // Offsets with their page and bank; in one bank pages are twice as large.
    for (dual_bank, cases) in [
        (
            true,
            [
                (0x3F800, 127, false),
                (0x40000, 0, true),
                (0x7F800, 127, true),
            ],
        ),
        (
            false,
            [
                (0x3F000, 63, false),
                (0x40000, 64, false),
                (0x7F000, 127, false),
            ],
        ),
    ] {
        let size = if dual_bank { 0x800 } else { 0x1000 };
        for (offset, number, bank2) in cases {
            let mut flash = unlocked(&FlashOptions {
                dual_bank,
                ..FlashOptions::default()
            });
            assert_eq!(
                flash.read(OPTR).unwrap_or(0) & OPTR_DBANK != 0,
                dual_bank,
                "DBANK"
            );
            assert!(flash.load(0, &vec![0x11; FLASH_BYTES as usize]));
            erase(&mut flash, number, bank2);
            let mut bytes = vec![0; FLASH_BYTES as usize];
            assert_eq!(flash.read_memory(0, &mut bytes), None);
            for (at, byte) in bytes.iter().enumerate() {
                let inside = (offset..offset + size).contains(&at);
                assert_eq!(*byte, if inside { 0xFF } else { 0x11 }, "at 0x{at:x}");
            }
            assert_eq!(notes(&mut flash), "");
        }
    }
}

#[test]
fn a_double_word_is_programmed_once() {
    let mut flash = unlocked(&FlashOptions::default());
    program(&mut flash, AT, WORD);
    program(&mut flash, AT, WORD & 0xFF);
    assert_eq!(status(&flash), SR_PROGERR);
    assert!(notes(&mut flash).contains("not erased"));
    assert_eq!(value(&mut flash, AT), WORD);
    // The flag stands in the way of whatever comes next.
    program(&mut flash, AT + 8, WORD);
    assert_eq!(status(&flash), SR_PROGERR | SR_PGSERR);
    assert!(notes(&mut flash).contains("clear them first"));
    flash.write(SR, SR_PROGERR | SR_PGSERR, T0);
    program(&mut flash, AT + 8, WORD);
    assert_eq!((status(&flash), value(&mut flash, AT + 8)), (0, WORD));
    // Zeros are allowed over anything.
    program(&mut flash, AT, 0);
    assert_eq!((status(&flash), value(&mut flash, AT)), (0, 0));
    // Ones are not nothing: the error correction code is written.
    program(&mut flash, AT + 16, u64::MAX);
    assert_eq!(notes(&mut flash), "");
    program(&mut flash, AT + 16, WORD);
    assert!(notes(&mut flash).contains("looks erased"));
}

#[test]
fn wrong_sequences_set_their_flag_and_store_nothing() {
    type Case = (u32, &'static str, fn(&mut Flash));
    let cases: [Case; 7] = [
        (SR_PGSERR, "without CR.PG", |flash| put(flash, AT, WORD, T0)),
        (SR_SIZERR, "2 bytes", |flash| {
            flash.write(CR, CR_PG, T0);
            flash.write_memory(AT, &[1, 2], T0);
        }),
        (SR_PGAERR, "lower and the upper", |flash| {
            flash.write(CR, CR_PG, T0);
            flash.write_memory(AT + 4, &[1, 2, 3, 4], T0);
        }),
        (SR_PGAERR, "lower and the upper", |flash| {
            flash.write(CR, CR_PG, T0);
            flash.write_memory(AT, &[1, 2, 3, 4], T0);
            flash.write_memory(AT + 12, &[1, 2, 3, 4], T0);
        }),
        (SR_PGSERR, "STRT without PER", |flash| {
            flash.write(CR, CR_STRT, T0);
        }),
        (SR_PGSERR, "or with PG", |flash| {
            flash.write(CR, page(0, true) | CR_PG | CR_STRT, T0);
        }),
        (SR_PGSERR | SR_OPERR, "BSY", |flash| {
            flash.write(CR, CR_PG | CR_ERRIE, T0);
            put(flash, AT + 8, WORD, T0);
            put(flash, AT, WORD, T0);
        }),
    ];
    for (flag, words, wrong) in cases {
        let mut flash = unlocked(&FlashOptions::default());
        wrong(&mut flash);
        assert_eq!(status(&flash) & !SR_BSY, flag, "{words}");
        assert_eq!(flash.irq(), flag & SR_OPERR != 0);
        let text = notes(&mut flash);
        assert!(text.contains(words), "{text}");
        flash.advance(T0 + ERASE);
        assert_eq!(value(&mut flash, AT), u64::MAX, "{words}");
    }
}

#[test]
fn protected_pages_stay() {
    let mut flash = unlocked(&FlashOptions {
        protected: Some(1..=2),
        ..FlashOptions::default()
    });
    program(&mut flash, AT, WORD);
    assert_eq!(status(&flash), SR_WRPERR);
    flash.write(SR, SR_WRPERR, T0);
    erase(&mut flash, 2, true);
    assert_eq!(status(&flash), SR_WRPERR);
    assert!(notes(&mut flash).contains("protect"));
    flash.write(SR, SR_WRPERR, T0);
    for (number, bank2) in [(1, false), (0, true), (3, true)] {
        erase(&mut flash, number, bank2);
    }
    assert_eq!((status(&flash), flash.figures().erased), (0, 3));
}

#[test]
fn the_bank_at_work_keeps_its_readers_waiting_and_the_other_does_not() {
    for (dual_bank, other_waits) in [(true, false), (false, true)] {
        let mut flash = unlocked(&FlashOptions {
            dual_bank,
            ..FlashOptions::default()
        });
        assert!(flash.load(0, &[1, 2, 3, 4]) && flash.load(AT, &[5, 6, 7, 8]));
        let number = if dual_bank { 1 } else { 64 };
        flash.write(CR, page(number, dual_bank) | CR_STRT, T0);
        let end = Some(T0 + ERASE);
        let mut bytes = [0; 4];
        let waits = flash.read_memory(0, &mut bytes);
        assert_eq!((waits.is_some(), bytes), (other_waits, [1, 2, 3, 4]));
        assert_eq!(flash.bank1_is_plain(), dual_bank);
        // The reader gets what is there afterwards.
        assert_eq!(flash.read_memory(AT, &mut bytes), end);
        assert_eq!(bytes, [0xFF; 4]);
        assert_eq!(flash.next_event(), end, "still under way");
        assert_eq!(notes(&mut flash), "");
    }
}

#[test]
fn the_data_cache_is_watched() {
    let mut flash = unlocked(&FlashOptions::default());
    flash.write(ACR, ACR_RESET | ACR_DCRST, T0);
    program(&mut flash, AT, WORD);
    assert!(notes(&mut flash).contains("ES0430"));
    flash.write(ACR, ACR_RESET & !ACR_DCEN, T0);
    flash.write(ACR, ACR_RESET, T0);
    assert!(notes(&mut flash).contains("old contents"));
    flash.write(ACR, ACR_RESET & !ACR_DCEN, T0);
    flash.write(ACR, ACR_RESET & !ACR_DCEN | ACR_DCRST, T0);
    flash.write(ACR, ACR_RESET & !ACR_DCEN, T0);
    flash.write(ACR, ACR_RESET, T0);
    assert_eq!(notes(&mut flash), "");
    flash.write(ACR, ACR_RESET | ACR_DCRST, T0);
    assert!(notes(&mut flash).contains("clear DCEN first"));
}

/// Cuts the program of `WORD` in half, or the erase of a page of zeros.
fn cut(seed: u64, erase: bool) -> Flash {
    let mut flash = unlocked(&FlashOptions {
        seed,
        ..FlashOptions::default()
    });
    if erase {
        assert!(flash.load(AT, &[0; 0x800]));
        flash.write(CR, page(1, true) | CR_STRT, T0);
    } else {
        flash.write(CR, CR_PG, T0);
        put(&mut flash, AT, WORD, T0);
    }
    flash.reset(T0 + Time::from_us(40));
    assert_eq!(flash.figures().cut, 1);
    assert_eq!((status(&flash), flash.next_event()), (0, None));
    flash
}

#[test]
fn a_cut_leaves_anything_in_the_words_concerned_and_nothing_elsewhere() {
    let (mut old, mut new, mut between, mut unreadable) = (0, 0, 0, 0);
    for seed in 0..64 {
        let mut flash = cut(seed, false);
        assert_eq!(flash.bank2(), cut(seed, false).bank2(), "seeded");
        match value(&mut flash, AT) {
            _ if flash.take_nmi() => {
                let eccr = flash.read(ECCR).unwrap_or(0);
                assert_eq!(eccr, ECCR_ECCD | ECCR_BANK | (AT - BANK_BYTES));
                assert_eq!(flash.bank2().unreadable().next(), Some(0x800));
                flash.write(ECCR, ECCR_ECCD, T0);
                assert_eq!(flash.read(ECCR).unwrap_or(0) & ECCR_DETECTED, 0);
                unreadable += 1;
            }
            u64::MAX => old += 1,
            WORD => new += 1,
            mixed => {
                assert_eq!(mixed & WORD, WORD, "no bit that was not to be");
                between += 1;
            }
        }
        assert_eq!(value(&mut flash, AT + 8), u64::MAX);
        assert_eq!(value(&mut flash, AT - 8), u64::MAX);
        assert!(!flash.take_nmi());
    }
    for count in [old, new, between, unreadable] {
        assert!(count > 5, "{old} {new} {between} {unreadable}");
    }
}

#[test]
fn a_page_whose_erase_was_cut_needs_another() {
    let mut looks = [0, 0, 0];
    for seed in 0..32 {
        let mut flash = cut(seed, true);
        let words: Vec<u64> = (0..0x100).map(|n| value(&mut flash, AT + 8 * n)).collect();
        match words.iter().filter(|word| **word == u64::MAX).count() {
            0x100 => looks[0] += 1,
            0 => looks[1] += 1,
            _ => looks[2] += 1,
        }
        flash.write(KEYR, KEYS[0], T0);
        flash.write(KEYR, KEYS[1], T0);
        flash.write(ACR, ACR_RESET & !ACR_DCEN, T0);
        program(&mut flash, AT, WORD);
        assert_ne!(notes(&mut flash), "", "however it looks");
        flash.write(SR, SR_CLEARABLE, T0);
        erase(&mut flash, 1, true);
        program(&mut flash, AT, WORD);
        assert_eq!(value(&mut flash, AT), WORD);
        assert_eq!(notes(&mut flash), "");
    }
    assert!(looks.iter().all(|count| *count > 2), "{looks:?}");
}

#[test]
fn bank_2_goes_from_one_board_to_the_next() {
    let mut flash = unlocked(&FlashOptions::default());
    program(&mut flash, AT, WORD);
    assert!(flash.load(0, &[1; 8]));
    let torn = (0..)
        .map(|seed| cut(seed, false).bank2())
        .find(|contents| contents.unreadable().next().is_some())
        .expect("some seed does");
    for contents in [flash.bank2(), torn] {
        let mut next = unlocked(&FlashOptions {
            bank2: Some(contents.clone()),
            ..FlashOptions::default()
        });
        assert_eq!(next.bank2(), contents);
        assert_eq!(value(&mut next, 0), u64::MAX, "bank 1 is not handed on");
        let mut bytes = [0; 8];
        next.read_memory(AT, &mut bytes);
        assert_eq!(&contents.bytes()[0x800..0x808], &bytes);
    }
}
