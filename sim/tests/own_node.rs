//! The board as a CANopen device: a client on the same bus reads and writes its
//! object dictionary while the master runs the network, and commands it.

mod common;
#[path = "common/ten_ms.rs"]
mod ten_ms;

use canmaster::id::Address;
use canmaster::nmt::{Command, NodeControl};
use canmaster::sdo::{AbortCode, Protocol, SdoError};
use canmaster::{CobId, Frame, NodeId};
use canmaster_sim::board::irqs;
use canmaster_sim::drive::DriveFault;
use canmaster_sim::time::Time;
use canmaster_sim::world::{Client, Image, Scenario, Stimulus, World, enabled};

use common::image;

const MASTER: NodeId = NodeId::constant::<127>();
const END: Time = Time::from_ms(20_000);
/// The silent phase is over and the board is in pre-operational.
const AWAKE: Time = Time::from_ms(700);
const HEARTBEAT: u16 = 0x77F;
const EMCY: u16 = 0x0FF;
const STOPPED: u8 = 0x04;

/// "conf".
const CONFIGURE: u32 = u32::from_le_bytes(*b"conf");

fn client(scenario: Scenario) -> Client<'static> {
    client_of(image(), scenario)
}

fn client_of(image: &'static Image, scenario: Scenario) -> Client<'static> {
    let world = World::new(image, scenario.unattended()).unwrap();
    Client::new(world, MASTER)
}

/// A client beside a master in standby.
fn in_standby(seed: u64) -> Client<'static> {
    standing_by(client(Scenario::new(seed, END)))
}

fn standing_by(mut client: Client<'static>) -> Client<'static> {
    assert!(client.world.run_to(Time::from_ms(4000), all_enabled));
    client.take_heard();
    client
}

/// A client beside a master without drives, in pre-operational.
fn alone(seed: u64) -> Client<'static> {
    let mut client = client(Scenario::new(seed, END).without_drives());
    client.listen(AWAKE);
    client
}

fn all_enabled(world: &World<'_>) -> bool {
    world.statuses().flatten().all(|status| enabled(&status))
}

/// The SYNC periods that the description allows.
fn described_cycles() -> std::ops::RangeInclusive<u32> {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../network.toml");
    let outcome = canmaster_network::load(file.as_ref());
    outcome.machine.unwrap().cycles()
}

fn at(index: u16, sub: u8) -> Address {
    Address::new(index, sub)
}

#[track_caller]
fn refused<T: std::fmt::Debug>(result: Result<T, SdoError>, expected: AbortCode) {
    match result {
        Err(SdoError::Aborted { code, .. }) => assert_eq!(code, expected),
        other => panic!("{other:?}"),
    }
}

fn say_nmt(client: &mut Client<'_>, command: Command) {
    client.say(NodeControl::node(command, MASTER).frame());
    client.listen(Time::from_ms(30));
}

/// What the board's last heartbeat within 150 ms says; `None`: there is none.
fn state(client: &mut Client<'_>) -> Option<u8> {
    client.take_heard();
    client.listen(Time::from_ms(150));
    client.heard_from(HEARTBEAT).last().map(|data| data[0])
}

#[test]
fn expedited_segmented_and_block_transfers_beside_the_running_network() {
    let mut client = in_standby(31);
    for protocol in [Protocol::Normal, Protocol::Block] {
        assert_eq!(client.read(at(0x1000, 0), protocol).unwrap(), [0; 4]);
        let name = client.read(at(0x1008, 0), protocol).unwrap();
        assert_eq!(name, b"canmaster");
        let dcf = client.read(at(0x1F22, 1), protocol).unwrap();
        assert!(dcf.len() > 100, "{} bytes", dcf.len());
        let words = client.read(at(0x2F01, 3), protocol).unwrap();
        assert_eq!(words, b"axis 3: operational");
    }
    // 1F82h: every drive is operational, and the board itself.
    for node in [1, 2, 3, 4, 5, 6, 127] {
        assert_eq!(client.number(0x1F82, node).unwrap(), 5);
    }
    // What follows from the design is constant; the SYNC is not to be touched now.
    refused(client.put(0x1000, 0, 0, 4), AbortCode::READ_ONLY);
    refused(client.put(0x1006, 0, 0, 4), AbortCode::DEVICE_STATE);
    // Nothing is saved while the axes are enabled.
    let normal = Protocol::Normal;
    for (index, signature) in [(0x1010, b"save"), (0x1011, b"load")] {
        let result = client.write(at(index, 1), signature, normal);
        refused(result, AbortCode::DEVICE_STATE);
    }
    assert!(all_enabled(&client.world));
}

#[test]
fn the_heartbeat_follows_1017h() {
    let mut client = in_standby(32);
    client.put(0x1017, 0, 100, 2).unwrap();
    client.take_heard();
    client.listen(Time::from_ms(2000));
    let count = client.heard_from(HEARTBEAT).len();
    assert!((19..=21).contains(&count), "{count} heartbeats in 2 s");
}

#[test]
fn the_boot_up_message_comes_before_the_first_heartbeat() {
    let mut client = alone(33);
    let heard = client.heard_from(HEARTBEAT);
    assert_eq!(heard[0], [0]);
    assert!(heard.len() > 1 && heard[1..].iter().all(|data| *data == [0x7F]));
}

/// CiA 301, 7.3.2.2: the services of each state, beside a network that is not
/// there.
#[test]
fn nmt_commands_from_the_bus_are_obeyed_while_no_axis_is_enabled() {
    let mut client = alone(34);
    assert_eq!(state(&mut client), Some(0x7F));
    // The network is not started: operational has to wait for that.
    say_nmt(&mut client, Command::Start);
    assert_eq!(state(&mut client), Some(0x7F));
    say_nmt(&mut client, Command::Stop);
    assert_eq!(state(&mut client), Some(0x04));
    assert!(matches!(
        client.number(0x1000, 0),
        Err(SdoError::Timeout { .. })
    ));
    say_nmt(&mut client, Command::EnterPreOperational);
    assert_eq!(state(&mut client), Some(0x7F));
    assert_eq!(client.number(0x1000, 0).unwrap(), 0);
    // To somebody else.
    client.say(NodeControl::node(Command::Stop, NodeId::constant::<126>()).frame());
    client.listen(Time::from_ms(30));
    assert_eq!(state(&mut client), Some(0x7F));
    // A reset takes back what was not saved.
    for command in [Command::ResetCommunication, Command::ResetNode] {
        client.put(0x1017, 0, 200, 2).unwrap();
        client.take_heard();
        say_nmt(&mut client, command);
        client.listen(AWAKE);
        assert!(client.heard_from(HEARTBEAT).contains(&vec![0]));
        assert_eq!(client.number(0x1017, 0).unwrap(), 50);
    }
    // Drives that are not there are not commanded.
    for (index, sub, value, bytes) in [
        (0x1F82, 1, 5, 1),
        (0x1F82, 99, 4, 1),
        (0x1F25, 1, CONFIGURE, 4),
    ] {
        let request = client.put(index, sub, value, bytes);
        refused(request, AbortCode::DEVICE_STATE);
    }
    // The same by 1F82h.
    client.put(0x1F82, 127, 7, 1).unwrap();
    client.take_heard();
    client.listen(AWAKE);
    assert!(client.heard_from(HEARTBEAT).contains(&vec![0]));
    client.put(0x1F82, 127, 4, 1).unwrap();
    client.listen(Time::from_ms(30));
    assert_eq!(state(&mut client), Some(0x04));
}

#[test]
fn no_command_takes_the_master_from_enabled_axes() {
    let mut client = in_standby(35);
    for value in [4, 6, 7, 127] {
        refused(client.put(0x1F82, 127, value, 1), AbortCode::DEVICE_STATE);
    }
    for command in [
        Command::Stop,
        Command::EnterPreOperational,
        Command::ResetNode,
        Command::ResetCommunication,
    ] {
        say_nmt(&mut client, command);
    }
    assert_eq!(state(&mut client), Some(5));
    assert!(all_enabled(&client.world));
}

#[test]
fn stopping_all_nodes_stops_the_board_once_the_axes_are_off() {
    let mut client = in_standby(36);
    client.say(NodeControl::all(Command::Stop).frame());
    client.listen(Time::from_ms(1500));
    assert_eq!(state(&mut client), Some(0x04));
    // No SYNC and no PDO in stopped.
    let heard = client.take_heard();
    let forbidden = |(_, frame): &&(Time, Frame)| matches!(frame.id().get(), 0x080 | 0x201..=0x206 | 0x301..=0x306);
    assert_eq!(heard.iter().find(forbidden), None);
}

#[test]
fn a_board_that_is_not_the_nmt_master_lives_under_another() {
    let mut client = alone(37);
    client.put(0x1F80, 0, 0, 4).unwrap();
    client
        .write(at(0x1010, 1), b"save", Protocol::Normal)
        .unwrap();
    client.take_heard();
    say_nmt(&mut client, Command::ResetNode);
    client.listen(Time::from_ms(3000));
    let heard = client.take_heard();
    let first = heard
        .iter()
        .position(|(_, frame)| frame.data() == [0] && frame.id().get() == HEARTBEAT);
    let after = &heard[first.expect("it boots")..];
    // Nothing but error control: no NMT, no SDO, no SYNC.
    for (time, frame) in after {
        assert_eq!(frame.id().get(), HEARTBEAT, "{time:?}: {frame:?}");
    }
    let states: Vec<u8> = after[1..]
        .iter()
        .map(|(_, frame)| frame.data()[0])
        .collect();
    assert!(states.len() > 50 && states.iter().all(|state| *state == 0x7F));
    // It is commanded as any other node.
    for (command, code) in [
        (Command::Start, 0x05),
        (Command::Stop, 0x04),
        (Command::EnterPreOperational, 0x7F),
        (Command::Start, 0x05),
    ] {
        say_nmt(&mut client, command);
        assert_eq!(state(&mut client), Some(code));
    }
    // It has nobody to command.
    refused(client.put(0x1F82, 1, 5, 1), AbortCode::DEVICE_STATE);
    refused(
        client.write(at(0x1F25, 1), b"conf", Protocol::Normal),
        AbortCode::DEVICE_STATE,
    );
    assert_eq!(client.number(0x1F82, 127).unwrap(), 5);
}

/// 1029h: 0 pre-operational, 1 no change, 2 stopped.
#[test]
fn a_lost_heartbeat_does_to_the_board_what_1029h_says() {
    for (behaviour, code) in [(0, 0x7F), (1, 0x05), (2, 0x04)] {
        let mut client = standing_by(client_of(ten_ms::image(), Scenario::new(38, END)));
        client.put(0x1029, 1, behaviour, 1).unwrap();
        let at = client.world.now();
        client.world.apply(Stimulus::Drive {
            node: NodeId::constant::<3>(),
            fault: DriveFault::HeartbeatLost { at },
        });
        client.take_heard();
        client.listen(Time::from_ms(2500));
        // 8130h: communication and generic, node 3.
        let told = client.heard_from(EMCY);
        assert!(
            told.contains(&vec![0x30, 0x81, 0x11, 3, 0, 0, 0, 0]),
            "{told:02X?}"
        );
        assert_eq!(state(&mut client), Some(code), "1029h = {behaviour}");
    }
}

#[test]
fn a_foreign_node_is_watched_if_1016h_says_so() {
    let mut client = alone(39);
    // Node 9, which the network does not name, takes the place of node 1.
    client.put(0x1016, 1, 9 << 16 | 100, 4).unwrap();
    client.put(0x1029, 1, 2, 1).unwrap();
    let beat = Frame::data_frame(CobId::new(0x709).unwrap(), &[5]).unwrap();
    for _ in 0..5 {
        client.say(beat);
        client.listen(Time::from_ms(80));
    }
    assert_eq!(state(&mut client), Some(STOPPED));
}

#[test]
fn pdos_of_wrong_length_are_told() {
    let mut client = alone(40);
    client.take_heard();
    for (len, code) in [(5, 0x10), (8, 0x20)] {
        let frame = Frame::data_frame(CobId::new(0x184).unwrap(), &[7; 8][..len]).unwrap();
        client.say(frame);
        client.listen(Time::from_ms(1100));
        let told = client.heard_from(EMCY);
        // 8210h or 8220h: node 4, TPDO1; over as soon as it is told.
        assert!(
            told.contains(&vec![code, 0x82, 0x11, 4, 1, 0, 0, 0]),
            "{len} bytes: {told:02X?}"
        );
    }
    let field: Vec<u32> = (1..=8)
        .filter_map(|sub| client.number(0x1003, sub).ok())
        .collect();
    for error in [0x0104_8210, 0x0104_8220] {
        assert!(field.contains(&error), "{field:08X?}");
    }
    // What was too short was left, what was too long was taken.
    assert_eq!(client.number(0x3004, 2).unwrap(), 0x0707_0707);
}

/// CiA 301, 7.5.2.5 .. 7.5.2.7, 7.5.2.22.
#[test]
fn the_sync_follows_1005h_1006h_and_1019h_in_pre_operational() {
    let mut client = alone(41);
    // What the check of network.toml lets through, to the microsecond.
    let (shortest, longest) = described_cycles().into_inner();
    let put = |client: &mut Client<'_>, us: u32| client.put(0x1006, 0, us, 4);
    refused(put(&mut client, shortest - 1), AbortCode::VALUE_TOO_LOW);
    refused(put(&mut client, longest + 1), AbortCode::VALUE_TOO_HIGH);
    for us in [shortest, longest, 10_000] {
        put(&mut client, us).unwrap();
    }
    // The deadline of the TPDOs, the step of the axes, the RPDOs and the guard.
    refused(client.put(0x1007, 0, 1_959, 4), AbortCode::VALUE_TOO_LOW);
    refused(client.put(0x1007, 0, 10_001, 4), AbortCode::VALUE_TOO_HIGH);
    refused(client.put(0x1019, 0, 3, 1), AbortCode::DEVICE_STATE);
    client.put(0x1006, 0, 0, 4).unwrap();
    client.put(0x1019, 0, 3, 1).unwrap();
    client.put(0x1006, 0, 20_000, 4).unwrap();
    client.put(0x1007, 0, 15_000, 4).unwrap();
    client.take_heard();
    client.put(0x1005, 0, 0x4000_0080, 4).unwrap();
    client.listen(Time::from_ms(100));
    let heard = client.heard_from(0x080);
    assert!((4..=6).contains(&heard.len()), "{heard:?}");
    for (counter, data) in [1, 2, 3].iter().cycle().zip(&heard) {
        assert_eq!(data, &[*counter]);
    }
    // Stopped: no SYNC, and the counter begins anew.
    say_nmt(&mut client, Command::Stop);
    client.take_heard();
    client.listen(Time::from_ms(100));
    assert!(client.heard_from(0x080).is_empty());
    say_nmt(&mut client, Command::EnterPreOperational);
    assert_eq!(client.heard_from(0x080)[0], [1]);
    client.put(0x1005, 0, 0x80, 4).unwrap();
    client.take_heard();
    client.listen(Time::from_ms(100));
    assert!(client.heard_from(0x080).is_empty());
}

/// CiA 301, 7.5.2.7: what would come after the window is not sent.
#[test]
fn synchronous_pdos_keep_to_the_window_of_1007h() {
    const WINDOW: Time = Time::from_us(7_500);
    let mut client = client_of(ten_ms::image(), Scenario::new(43, END).without_drives());
    client.listen(AWAKE);
    client.put(0x1007, 0, 7_500, 4).unwrap();
    client
        .write(at(0x1010, 1), b"save", Protocol::Normal)
        .unwrap();
    let stored = client.world.board().bank2();
    let mut client = client_of(ten_ms::image(), Scenario::new(44, END).stored(stored));
    assert!(client.world.run_to(Time::from_ms(4000), all_enabled));
    // A TPDO is missing, so that the deadline makes the cycle, and it is late:
    // past the window in a good part of the cycles.
    let at = client.world.now();
    client.world.apply(Stimulus::Drive {
        node: NodeId::constant::<3>(),
        fault: DriveFault::TpdosLost { at },
    });
    client.world.apply(Stimulus::DelayIrq {
        irq: irqs::TIM3,
        max_cycles: 170_000 * 4,
    });
    client.take_heard();
    client.listen(Time::from_ms(600));
    let mut sync = None;
    let (mut sent, mut cycles) = (0, 0);
    for (at, frame) in client.take_heard() {
        match frame.id().get() {
            0x080 => {
                cycles += 1;
                sync = Some(at);
            }
            0x201..=0x206 | 0x301..=0x306 => {
                sent += 1;
                // As seen by somebody who looks every 200 us.
                let late = sync.map(|sync| at - sync);
                assert!(late <= Some(WINDOW + Time::from_us(400)), "{late:?}");
            }
            _ => {}
        }
    }
    assert!(
        sent > 0 && sent < cycles * 5,
        "{sent} RPDOs in {cycles} cycles"
    );
}

/// CiA 301, 7.2.6.
#[test]
fn time_is_sent_once_the_clock_is_set() {
    let mut client = alone(42);
    client.put(0x2F11, 0, 100, 2).unwrap();
    client.put(0x1012, 0, 0x4000_0100, 4).unwrap();
    client.listen(Time::from_ms(300));
    assert!(client.heard_from(0x100).is_empty());
    // 2026-11-22, 12:00: day 15 666.
    let noon = [0x00, 0x2E, 0x93, 0x02, 0x32, 0x3D];
    client
        .write(at(0x2F10, 0), &noon, Protocol::Normal)
        .unwrap();
    client.take_heard();
    client.listen(Time::from_ms(1000));
    let heard = client.heard_from(0x100);
    assert!((9..=11).contains(&heard.len()), "{}", heard.len());
    let ms = |data: &Vec<u8>| u32::from_le_bytes(data[..4].try_into().unwrap());
    for pair in heard.windows(2) {
        let step = ms(&pair[1]) - ms(&pair[0]);
        assert!((99..=101).contains(&step), "{step} ms");
        assert_eq!(pair[0][4..], noon[4..]);
    }
}
