//! Frames of every length to every identifier, on the bus of the real image: it
//! neither crashes nor hangs, and nothing moves.

mod common;

use canmaster::NodeId;
use canmaster_sim::frame::{WireFrame, WireId};
use canmaster_sim::time::Time;
use canmaster_sim::world::{Client, Scenario, World, enabled};
use common::image;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

const MASTER: NodeId = NodeId::constant::<127>();
const END: Time = Time::from_ms(20_000);
/// A frame of eight bytes at 1 Mbit/s, and a bit of room for the others.
const APART: Time = Time::from_us(150);

fn client(scenario: Scenario) -> Client<'static> {
    let world = World::new(image(), scenario.unattended()).unwrap();
    Client::new(world, MASTER)
}

/// Any frame with this identifier: data or remote, any length, any content.
fn any_frame(random: &mut Pcg64Mcg, id: WireId) -> WireFrame {
    WireFrame {
        id,
        rtr: random.random_ratio(1, 8),
        // 9 ..= 15 mean eight bytes.
        dlc: random.random_range(0..=15),
        data: random.random(),
    }
}

fn say(client: &mut Client<'_>, frame: WireFrame) {
    while !client.world.say(frame) {
        client.listen(APART);
    }
    client.listen(APART);
}

/// The board answers, was never reset, and made nothing wrong with its registers.
#[track_caller]
fn assert_sound(mut client: Client<'_>) {
    client.listen(Time::from_ms(300));
    assert_eq!(client.number(0x1000, 0).unwrap(), 0);
    let record = client.world.finish();
    assert_eq!(record.complaints, [""; 0]);
    for axis in &record.axes {
        if let Some(status) = &axis.status {
            assert_eq!(status.moved_at, None, "node {}", axis.node);
        }
    }
}

#[test]
fn every_identifier_and_length_in_pre_operational() {
    let mut client = client(Scenario::new(91, END).without_drives());
    client.listen(Time::from_ms(700));
    let random = &mut Pcg64Mcg::seed_from_u64(91);
    for _ in 0..2 {
        // An NMT command to the board would be obeyed.
        for number in 1..0x800 {
            let frame = any_frame(random, WireId::Standard(number));
            say(&mut client, frame);
        }
    }
    for _ in 0..300 {
        let id = WireId::Extended(random.random());
        let frame = any_frame(random, id);
        say(&mut client, frame);
    }
    assert_sound(client);
}

#[test]
fn whatever_the_board_listens_to_while_the_axes_are_enabled() {
    let mut client = client(Scenario::new(92, END));
    let all_enabled = |world: &World<'_>| world.statuses().flatten().all(|status| enabled(&status));
    assert!(client.world.run_to(END, all_enabled), "not enabled");
    let random = &mut Pcg64Mcg::seed_from_u64(92);
    // Not what the drives obey: that would say nothing of the board.
    let heard = [
        0x081..=0x0FF_u16,
        0x100..=0x100,
        0x181..=0x1FF,
        0x281..=0x2FF,
        0x581..=0x5FF,
        0x67F..=0x67F,
        0x701..=0x77F,
        0x7E4..=0x7E4,
    ];
    for numbers in heard {
        for number in numbers {
            let frame = any_frame(random, WireId::Standard(number));
            say(&mut client, frame);
        }
    }
    // Extended identifiers whose last eleven bits look like these.
    for number in (0x180..0x200).chain(0x700..0x780) {
        let frame = any_frame(random, WireId::Extended(0x1234_0000 | number));
        say(&mut client, frame);
    }
    assert_sound(client);
}
