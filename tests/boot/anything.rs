//! Every frame of every length to every COB-ID, in every state of the boot-up.

use crate::networks::{assign, network, optional, unconfigured};
use crate::rig::{OPERATIONAL, PRE_OPERATIONAL, Rig, ms};
use canmaster::boot::{Assignment, Startup};
use canmaster::nmt::{Command, NodeControl};
use canmaster::{CobId, Frame};

const KEEP_ALIVE: u32 = Assignment::KEEP_ALIVE;
const SERIAL: u32 = 0x4711;

/// Node 2 waits for an answer that does not come.
fn mute(entry: (u16, u8)) -> Rig {
    let mut rig = Rig::new(network(2, |_, _| {}));
    rig.fakes[1].mute = Some(entry);
    rig.run_for(ms(850));
    rig
}

fn running(bits: u32) -> Rig {
    let mut rig = Rig::with(network(2, |_, _| {}), |settings| settings.startup.0 |= bits);
    rig.run_for(ms(2000));
    assert!(rig.boot.is_ready());
    rig
}

/// Nobody has told yet which nodes have no node-ID.
fn scanning(after: u32) -> Rig {
    let mut rig = Rig::new(network(2, |node, _| node.serial = Some(SERIAL)));
    unconfigured(&mut rig.fakes[1], SERIAL);
    rig.run_for(ms(2100 + after));
    rig
}

/// A state: a name, what shows that it is that one, and the way there.
type Place = (&'static str, &'static str, fn() -> Rig);

const STATES: &[Place] = &[
    ("silent", "phase: Silent", || {
        Rig::new(network(2, |_, _| {}))
    }),
    ("another device is the master", "phase: NotMaster", || {
        Rig::with(network(2, |_, _| {}), |settings| {
            settings.startup = Startup(0)
        })
    }),
    ("boot-up frame awaited", "state: AwaitBootUp(", || {
        let mut rig = Rig::new(network(2, |_, _| {}));
        rig.fakes[1].missing = true;
        rig.run_for(ms(850));
        rig
    }),
    (
        "device type asked for",
        "state: Identify(Identify { item: 0 })",
        || mute((0x1000, 0)),
    ),
    (
        "product code asked for",
        "state: Identify(Identify { item: 2 })",
        || mute((0x1018, 2)),
    ),
    ("device type to be asked for again", "state: Retry(", || {
        let mut rig = mute((0x1000, 0));
        rig.run_for(ms(650));
        rig
    }),
    ("state awaited", "state: AwaitState(", || {
        let mut rig = Rig::with(network(2, |_, _| {}), assign(2, KEEP_ALIVE));
        rig.fakes[1].runs(OPERATIONAL, None);
        rig.run_for(ms(650));
        rig
    }),
    ("reset on the way", "restored: false", || {
        let mut rig = Rig::with(network(2, |_, _| {}), assign(2, KEEP_ALIVE));
        rig.fakes[1].runs(PRE_OPERATIONAL, Some(ms(100)));
        rig.run_for(ms(750));
        rig
    }),
    ("signature asked for", "state: Verify(", || {
        let mut rig = Rig::new(network(2, |_, kind| kind.configured = [1, 2]));
        rig.fakes[1].set((0x1020, 1), 7);
        rig.fakes[1].set((0x1020, 2), 7);
        rig.fakes[1].mute = Some((0x1020, 1));
        rig.run_for(ms(850));
        rig
    }),
    ("parameters being restored", "state: Restore(", || {
        let mut rig = Rig::with(network(2, |_, _| {}), |settings| {
            assign(2, Assignment::RESTORE)(settings);
            settings.nodes[1].restore = 1;
        });
        rig.fakes[1].mute = Some((0x1011, 1));
        rig.run_for(ms(850));
        rig
    }),
    ("reset after that", "restored: true", || {
        let mut rig = Rig::with(network(2, |_, _| {}), |settings| {
            assign(2, Assignment::RESTORE)(settings);
            settings.nodes[1].restore = 1;
        });
        rig.run_for(ms(850));
        rig
    }),
    ("configuring", "state: Configure(", || mute((0x6060, 0))),
    ("heartbeat awaited", "state: AwaitErrorControl(", || {
        let mut rig = Rig::new(network(2, |_, _| {}));
        rig.fakes[1].no_heartbeat = true;
        rig.run_for(ms(850));
        rig
    }),
    ("ready, another one is awaited", "state: Ready(", || {
        let mut rig = Rig::new(network(2, |_, _| {}));
        rig.fakes[0].missing = true;
        rig.run_for(ms(950));
        rig
    }),
    ("order awaited", "phase: AwaitingOrder", || {
        let mut rig = Rig::with(network(2, |_, _| {}), |settings| {
            settings.startup.0 |= Startup::NOT_BY_ITSELF;
        });
        rig.run_for(ms(1500));
        rig
    }),
    ("SYNC runs", "phase: Synchronising", || {
        let mut rig = Rig::new(network(2, |_, _| {}));
        rig.run_for(ms(910));
        assert!(rig.sync);
        rig
    }),
    ("starting", "state: Starting(", || {
        let mut rig = Rig::new(network(2, |_, _| {}));
        rig.run_for(ms(950));
        assert_eq!(rig.nmt().last(), Some(&[0x01, 0]));
        rig
    }),
    ("running", "phase: Running", || running(0)),
    ("node lost", "lost: true", || {
        let mut rig = running(0);
        rig.boot.node_lost(crate::rig::id(2));
        rig.run();
        rig
    }),
    ("optional node given up", "state: GivenUp(", || {
        let mut rig = Rig::new(network(2, optional));
        rig.fakes[1].missing = true;
        rig.run_for(ms(3000));
        rig
    }),
    ("failed", "phase: Failed", || {
        let mut rig = Rig::new(network(2, |_, _| {}));
        rig.fakes[1].missing = true;
        rig.run_for(ms(3000));
        assert!(rig.boot.is_failed());
        rig
    }),
    ("stopped", "phase: Stopped", || {
        let mut rig = running(Startup::STOP_ALL);
        rig.boot.node_lost(crate::rig::id(2));
        rig.run();
        rig
    }),
    ("bus-off", "phase: BusOff", || {
        let mut rig = running(0);
        rig.boot.bus_off(rig.now);
        rig.run();
        rig
    }),
    ("is anybody without node-ID", "left: 128", || scanning(10)),
    ("serial number asked for", "part: Serial, left: 0", || {
        scanning(210)
    }),
    ("node-ID given", "step: Give", || {
        let mut rig = scanning(240);
        rig.fakes[1].missing = true;
        rig.run_for(ms(20));
        rig
    }),
];

#[test]
fn the_states_are_what_they_are_called() {
    for (name, shown, state) in STATES {
        let boot = std::format!("{:?}", rest(*state).boot);
        assert!(boot.contains(shown), "{name}");
    }
}

/// The same state, with what was sent and told so far forgotten.
fn rest(state: fn() -> Rig) -> Rig {
    let mut rig = state();
    rig.run();
    rig.forget();
    rig
}

/// Everything that is wrong with the nodes is put right, and all are reset.
fn recover(mut rig: Rig, name: &str) {
    for fake in &mut rig.fakes {
        fake.missing = false;
        fake.mute = None;
        fake.no_heartbeat = false;
        fake.lss = None;
    }
    rig.fakes[1].id = 2;
    // The longest way to where a request is heard: pauses, silence, boot time.
    rig.run_for(ms(4000));
    let reset = NodeControl::all(Command::ResetCommunication);
    assert_eq!(rig.boot.request(reset, rig.now), Ok(()), "{name}");
    rig.run_for(ms(2000));
    let start = NodeControl::all(Command::Start);
    // Where the start is left to the application.
    let _ = rig.boot.request(start, rig.now);
    rig.run_for(ms(500));
    assert!(rig.boot.is_ready(), "{name}: {:?}", rig.events);
}

/// What may mean something to the boot-up: its COB-ID and length.
const MEANT: [(u16, u8); 5] = [(0x581, 8), (0x582, 8), (0x701, 1), (0x702, 1), (0x7E4, 8)];

#[test]
fn frames_that_mean_nothing_change_nothing() {
    for (name, _, state) in STATES {
        let mut rig = rest(*state);
        let deadline = rig.boot.next_deadline();
        for number in 0..0x800 {
            let id = CobId::new(number).unwrap();
            for len in 0..=8 {
                let remote = Frame::remote_frame(id, len).unwrap();
                rig.boot.on_frame(&remote, rig.now);
                if MEANT.contains(&(number, len)) {
                    continue;
                }
                for first in [0x00, 0x05, 0x43, 0x4F, 0x60, 0x80, 0xFF] {
                    let data = [first, 0x00, 0x10, 0x00, 1, 2, 3, 4];
                    let frame = Frame::data_frame(id, &data[..usize::from(len)]).unwrap();
                    rig.boot.on_frame(&frame, rig.now);
                }
            }
        }
        rig.run();
        assert_eq!((rig.sent.len(), &rig.events[..]), (0, &[][..]), "{name}");
        assert_eq!(rig.boot.next_deadline(), deadline, "{name}");
    }
}

/// Starts that were sent.
fn starts(rig: &Rig) -> usize {
    rig.nmt()
        .iter()
        .filter(|[command, _]| *command == 0x01)
        .count()
}

#[test]
fn every_state_of_error_control_in_every_state() {
    for (name, _, state) in STATES {
        for number in [0x701, 0x702] {
            for byte in 0..=u8::MAX {
                let name = std::format!("{name}: {number:03X}#{byte:02X}");
                let mut rig = rest(*state);
                let frame = Frame::data_frame(CobId::new(number).unwrap(), &[byte]).unwrap();
                rig.boot.on_frame(&frame, rig.now);
                rig.run();
                // One frame of one node is not enough for a start.
                assert_eq!(starts(&rig), 0, "{name}");
                // Those that no state of the standard has are all alike.
                let known = matches!(byte & 0x7F, 0x00 | 0x04 | 0x05 | 0x7F);
                if (known || byte == 0x33) && !name.starts_with("another device") {
                    recover(rig, &name);
                }
            }
        }
    }
}

#[test]
fn every_answer_of_sdo_in_every_state() {
    let places = [
        [0x00, 0x10, 0x00],
        [0x18, 0x10, 0x02],
        [0x60, 0x60, 0x00],
        [0xFF; 3],
    ];
    let values = [[0x92, 0x01, 0x02, 0x00], [0, 0, 0x50, 0x61], [0xFF; 4]];
    for (name, _, state) in STATES {
        for command in 0..=u8::MAX {
            for [p0, p1, p2] in places {
                for [v0, v1, v2, v3] in values {
                    let data = [command, p0, p1, p2, v0, v1, v2, v3];
                    let name = std::format!("{name}: {data:02X?}");
                    let mut rig = rest(*state);
                    let frame = Frame::full(CobId::new(0x582).unwrap(), data);
                    rig.boot.on_frame(&frame, rig.now);
                    rig.run();
                    assert_eq!(starts(&rig), 0, "{name}");
                    assert!(rig.sent.len() <= 40, "{name}");
                    // Once for each kind of command.
                    if command & 0x1F == 0x03 && !name.starts_with("another device") {
                        recover(rig, &name);
                    }
                }
            }
        }
    }
}

#[test]
fn every_answer_of_lss_in_every_state() {
    for (name, _, state) in STATES {
        for command in 0..=u8::MAX {
            for error in [0, 1, 255] {
                let data = [command, error, 7, 0, 0, 0, 0, 0];
                let name = std::format!("{name}: {data:02X?}");
                let mut rig = rest(*state);
                rig.boot
                    .on_frame(&Frame::full(CobId::LSS_SLAVE, data), rig.now);
                rig.run();
                assert_eq!(starts(&rig), 0, "{name}");
                let known = matches!(command, 0x11 | 0x17 | 0x44 | 0x4F | 0x00);
                if known && !name.starts_with("another device") {
                    recover(rig, &name);
                }
            }
        }
    }
}

#[test]
fn whether_a_request_would_be_carried_out_is_known_before() {
    let mut carried_out = 0;
    for (name, _, state) in STATES {
        for command in [0x01, 0x02, 0x80, 0x81, 0x82, 0x33] {
            for node in [0, 1, 2, 9, 127] {
                let command = Command::from_code(command);
                let control = match node {
                    0 => NodeControl::all(command),
                    node => NodeControl::node(command, crate::rig::id(node)),
                };
                let mut rig = rest(*state);
                let foretold = rig.boot.may_request(control);
                let told = rig.boot.request(control, rig.now);
                assert_eq!(foretold, told, "{name}: {control:?}");
                rig.run();
                if told.is_err() {
                    assert_eq!(
                        (rig.sent.len(), rig.events.len()),
                        (0, 0),
                        "{name}: {control:?}"
                    );
                }
                carried_out += u32::from(told.is_ok());
            }
        }
    }
    assert!(carried_out > 50, "{carried_out}");
}
