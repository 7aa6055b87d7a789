//! 1010h and 1011h of the real image, with the supply cut in the middle of it.

mod common;

use canmaster::NodeId;
use canmaster::id::Address;
use canmaster::nmt::{Command, NodeControl};
use canmaster::sdo::{AbortCode, Protocol, SdoError};
use canmaster_sim::board::{BankContents, ResetCause};
use canmaster_sim::time::Time;
use canmaster_sim::world::{Client, Scenario, Stimulus, World};
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use common::image;

const MASTER: NodeId = NodeId::constant::<127>();
const END: Time = Time::from_ms(60_000);
/// The silent phase is over and the board is in pre-operational.
const AWAKE: Time = Time::from_ms(700);
/// Sets that fit a page of the flash.
const PER_PAGE: u32 = 4;

fn power_on(scenario: Scenario) -> Client<'static> {
    let world = World::new(image(), scenario.without_drives().unattended()).unwrap();
    let mut client = Client::new(world, MASTER);
    client.listen(AWAKE);
    client
}

/// Takes the supply away and gives it back.
fn power_cycle(client: &mut Client<'_>) {
    client.world.apply(Stimulus::Power(false));
    client.listen(Time::from_ms(20));
    client.world.apply(Stimulus::Power(true));
    client.listen(AWAKE);
}

/// Two settings, far from each other in the set, that show which set it is.
fn put(client: &mut Client<'_>, n: u32) {
    client.put(0x1015, 0, n, 2).unwrap();
    client.put(0x1F89, 0, 1000 + n, 4).unwrap();
}

fn set(client: &mut Client<'_>) -> Option<u32> {
    let n = client.number(0x1015, 0).unwrap();
    match client.number(0x1F89, 0).unwrap() {
        1500 if n == 0 => None,
        time => {
            assert_eq!(time, 1000 + n, "a mixture of two sets");
            Some(n)
        }
    }
}

fn order(client: &mut Client<'_>, index: u16, signature: &[u8; 4]) -> Result<(), SdoError> {
    client.write(Address::new(index, 1), signature, Protocol::Normal)
}

/// No reset but those ordered, no wrong use of the flash.
fn is_sound(client: Client<'_>) {
    let record = client.world.finish();
    for reset in &record.board.resets {
        assert!(
            matches!(reset.cause, ResetCause::PowerOn | ResetCause::Software),
            "{reset:?}"
        );
    }
    let flash: Vec<_> = record
        .complaints
        .iter()
        .filter(|text| !text.contains("reset"))
        .collect();
    assert!(flash.is_empty(), "{flash:?}");
}

#[test]
fn settings_are_saved_restored_and_taken_over_at_the_next_start() {
    let mut client = power_on(Scenario::new(51, END));
    assert_eq!(client.number(0x1010, 1).unwrap(), 1);
    assert_eq!(client.number(0x1011, 1).unwrap(), 1);
    assert_eq!(set(&mut client), None);
    put(&mut client, 7);
    client.put(0x1017, 0, 100, 2).unwrap();
    // Not saved: gone.
    power_cycle(&mut client);
    assert_eq!(set(&mut client), None);

    put(&mut client, 8);
    client.put(0x1017, 0, 100, 2).unwrap();
    order(&mut client, 0x1010, b"save").unwrap();
    power_cycle(&mut client);
    assert_eq!(set(&mut client), Some(8));
    // What other tasks go by is in force, too.
    client.take_heard();
    client.listen(Time::from_ms(1000));
    let count = client.heard_from(0x77F).len();
    assert!((9..=11).contains(&count), "{count} heartbeats in 1 s");

    // "load" takes effect at the next reset.
    let wrong = order(&mut client, 0x1011, b"save");
    assert!(matches!(
        wrong,
        Err(SdoError::Aborted {
            code: AbortCode::CANNOT_STORE,
            ..
        })
    ));
    order(&mut client, 0x1011, b"load").unwrap();
    assert_eq!(set(&mut client), Some(8));
    client.say(NodeControl::node(Command::ResetCommunication, MASTER).frame());
    client.listen(AWAKE + Time::from_ms(50));
    assert_eq!(set(&mut client), None);
    is_sound(client);
}

#[test]
fn nothing_is_saved_with_one_bank() {
    let mut scenario = Scenario::new(52, END);
    scenario.flash.dual_bank = false;
    let mut client = power_on(scenario);
    assert_eq!(client.number(0x1010, 1).unwrap(), 0);
    for (index, signature) in [(0x1010, b"save"), (0x1011, b"load")] {
        assert!(matches!(
            order(&mut client, index, signature),
            Err(SdoError::Aborted {
                code: AbortCode::DEVICE_STATE,
                ..
            })
        ));
    }
    is_sound(client);
}

/// A flash whose newest set is `n`, the last that its page has room for: the
/// next save erases the other page.
fn full_page(n: u32) -> BankContents {
    let mut client = power_on(Scenario::new(53, END));
    for n in n + 1 - PER_PAGE..=n {
        put(&mut client, n);
        order(&mut client, 0x1010, b"save").unwrap();
    }
    let contents = client.world.board().bank2();
    is_sound(client);
    contents
}

/// Ten moments in the 27 ms that a save with an erase takes.
#[test]
fn a_power_cut_leaves_the_old_or_the_new_set() {
    const CUTS: u64 = 10;
    const OLD: u32 = 10;
    const NEW: u32 = 11;
    let before = full_page(OLD);
    let mut random = Pcg64Mcg::seed_from_u64(54);
    let mut cut = 0;
    for n in 0..CUTS {
        let mut client = power_on(Scenario::new(60 + n, END).stored(before.clone()));
        assert_eq!(set(&mut client), Some(OLD));
        put(&mut client, NEW);
        // Half of the cuts in the erase, half while words are written.
        let after_us = if n % 2 == 0 {
            random.random_range(300..22_000)
        } else {
            random.random_range(22_000..26_000)
        };
        let save = canmaster::Frame::full(
            canmaster::CobId::new(0x67F).unwrap(),
            *b"\x23\x10\x10\x01save",
        );
        client.say(save);
        client.listen(Time::from_us(after_us));
        client.world.apply(Stimulus::Power(false));
        cut += client.world.board().stats().flash.cut;
        client.listen(Time::from_ms(5));
        client.world.apply(Stimulus::Power(true));
        client.listen(AWAKE);
        let found = set(&mut client);
        assert!(
            found == Some(OLD) || found == Some(NEW),
            "cut after {after_us} us: {found:?}"
        );
        // It goes on from there.
        put(&mut client, NEW + 1);
        order(&mut client, 0x1010, b"save").unwrap();
        power_cycle(&mut client);
        assert_eq!(set(&mut client), Some(NEW + 1));
        is_sound(client);
    }
    assert!(cut >= CUTS / 2, "{cut} operations were cut");
}
