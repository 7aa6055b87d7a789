//! The group led over CAN: a client on the bus enables, releases, moves and stops it by
//! SDO, changes modes, loads a program and follows it by the board's own TPDOs.

use canmaster::id::Address;
use canmaster::motion::{GroupState, panel};
use canmaster::sdo::{AbortCode, Protocol, SdoError};
use canmaster::{CobId, Frame, NodeId};
use canmaster_sim::judge::coordination;
use canmaster_sim::time::Time;
use canmaster_sim::world::{Scenario, enabled};

use crate::leader::{
    AXES, DISABLE, ENABLE, END, HALT, RELEASE, RUN, SET_MODES, START, STOP, all_enabled, arrived,
    command, compiled, emergencies, in_standby, positions, put_targets, refused, run, state, until,
    until_done,
};

#[test]
fn enable_release_move_and_stop_by_sdo() {
    let mut client = in_standby(41);
    let from = positions(&mut client);
    put_targets(&mut client, 6000);
    // Nothing moves before a release.
    let standby = 0xFF01_0000 | GroupState::Standby as u32;
    let done = command(&mut client, START);
    refused(&mut client, done, AbortCode::DEVICE_STATE, standby);
    command(&mut client, RELEASE).unwrap();
    until(&mut client, GroupState::Moving);
    command(&mut client, START).unwrap();
    client.listen(Time::from_ms(1500));
    arrived(&mut client, &from, 6000);
    // Stopped on the way, all axes come to rest.
    put_targets(&mut client, 40_000);
    command(&mut client, START).unwrap();
    client.listen(Time::from_ms(600));
    command(&mut client, STOP).unwrap();
    until(&mut client, GroupState::Standby);
    let rest = positions(&mut client);
    client.listen(Time::from_ms(300));
    arrived(&mut client, &rest, 0);
    assert!(rest[0] - from[0] < 35_000 && rest[0] - from[0] > 6000);
    command(&mut client, DISABLE).unwrap();
    until(&mut client, GroupState::Idle);
    assert!(
        !client
            .world
            .statuses()
            .flatten()
            .any(|status| enabled(&status))
    );
    command(&mut client, ENABLE).unwrap();
    until(&mut client, GroupState::Standby);
    assert!(all_enabled(&client.world));
}

#[test]
fn a_mode_is_changed_at_standstill_and_confirmed() {
    let mut client = in_standby(42);
    for axis in 1..=AXES {
        client.put(panel::MODE, axis, 8, 1).unwrap();
    }
    // Not while the group is released.
    command(&mut client, RELEASE).unwrap();
    until(&mut client, GroupState::Moving);
    let moving = 0xFF01_0000 | GroupState::Moving as u32;
    let done = command(&mut client, SET_MODES);
    refused(&mut client, done, AbortCode::DEVICE_STATE, moving);
    command(&mut client, STOP).unwrap();
    until(&mut client, GroupState::Standby);
    command(&mut client, SET_MODES).unwrap();
    client.listen(Time::from_ms(500));
    until(&mut client, GroupState::Standby);
    assert!(
        client
            .world
            .statuses()
            .flatten()
            .all(|status| status.mode == 8)
    );
    for axis in 1..=AXES {
        assert_eq!(client.number(panel::MODE, axis), Ok(8));
    }
    // RPDO3 carries the target position, RPDO1 is not sent any more.
    let from = positions(&mut client);
    put_targets(&mut client, 5000);
    command(&mut client, RELEASE).unwrap();
    until(&mut client, GroupState::Moving);
    client.take_heard();
    command(&mut client, START).unwrap();
    client.listen(Time::from_ms(1500));
    assert!(client.heard_from(0x201).is_empty());
    arrived(&mut client, &from, 5000);
    // All six start with one SYNC and arrive with one SYNC. In whole increments the
    // shorter ways are seen to begin a little later, and to end a little earlier.
    let mut target = 5000;
    for (longer, apart) in [(0, 0), (3000, 4)] {
        target += 12_000;
        for axis in 1..=AXES {
            let to = target + longer * u32::from(axis);
            client.put(panel::TARGET, axis, to, 4).unwrap();
        }
        command(&mut client, START).unwrap();
        client.listen(Time::from_ms(2500));
        let wire = [client.world.wire()];
        let network = client.world.machine().network();
        let spans = coordination::spans(wire.into_iter(), network);
        let last = &spans[spans.len() - usize::from(AXES)..];
        for span in last {
            let (start, end) = (last[0].start.sync, last[0].end.sync);
            let axis = span.axis;
            assert!(span.start.sync.abs_diff(start) <= apart, "axis {axis}");
            assert!(span.end.sync.abs_diff(end) <= apart, "axis {axis}");
        }
        let mut all: Vec<usize> = last.iter().map(|span| span.axis).collect();
        all.sort_unstable();
        assert_eq!(all, [0, 1, 2, 3, 4, 5]);
    }
    // A stop brings it back to standby.
    command(&mut client, STOP).unwrap();
    until(&mut client, GroupState::Standby);
}

/// No drive misses its target on the way, whichever mode it leaves or enters.
#[test]
fn from_every_mode_to_every_other() {
    const MODES: [u8; 6] = [1, 3, 6, 8, 9, 10];
    let mut tour = Vec::new();
    for (n, from) in MODES.into_iter().enumerate() {
        for to in &MODES[n + 1..] {
            tour.extend([from, *to]);
        }
    }
    tour.push(MODES[0]);
    let mut client = in_standby(44);
    client.take_heard();
    for mode in tour {
        for axis in 1..=AXES {
            client.put(panel::MODE, axis, mode.into(), 1).unwrap();
        }
        command(&mut client, SET_MODES).unwrap();
        client.listen(Time::from_ms(50));
        until(&mut client, GroupState::Standby);
        let modes = client.world.statuses().flatten();
        assert!(
            modes
                .map(|status| status.mode)
                .all(|shown| shown == mode as i8)
        );
        let said = emergencies(&mut client);
        assert!(said.is_empty(), "mode {mode}: {said:?}");
    }
}

/// Set-points of profile position mode: counted from the one before, one after the
/// other, and one that replaces another.
#[test]
fn profile_position_is_relative_buffered_and_immediate() {
    let mut client = in_standby(47);
    let program = |settle: bool| {
        compiled(&format!(
            "unit = \"turns\"\nvelocity = 1000\nacceleration = 2000\n\
             [[step]]\n[step.mode]\nis = \"profile position\"\n\
             [[step]]\nsettle = {settle}\n[[step.move]]\nby = [1, -1, 2, -2, 1, 1]\n\
             [[step]]\n[[step.move]]\nby = [2, -1, 1, -1, 1, -3]\n"
        ))
    };
    let ways = [3, -2, 3, -3, 2, -2];
    let mut from = positions(&mut client);
    for settle in [true, false] {
        run(&mut client, &program(settle));
        until_done(&mut client, Time::from_ms(8000));
        let now = positions(&mut client);
        for ((from, now), way) in from.iter().zip(&now).zip(ways) {
            let off = now - from - 2000 * way;
            assert!(off.abs() <= 5, "{off} beside {way} turns, settle {settle}");
        }
        from = now;
    }
    assert!(
        client
            .world
            .statuses()
            .flatten()
            .all(|status| status.mode == 1)
    );
    // Replaced on the way: never where the first one led to.
    command(&mut client, RELEASE).unwrap();
    until(&mut client, GroupState::Moving);
    put_targets(&mut client, 40_000);
    command(&mut client, START).unwrap();
    client.listen(Time::from_ms(300));
    put_targets(&mut client, 10_000);
    command(&mut client, START).unwrap();
    let mut farthest = 0;
    for _ in 0..300 {
        client.listen(Time::from_ms(10));
        farthest = farthest.max(positions(&mut client)[0]);
    }
    assert!(farthest < 30_000, "{farthest}");
    command(&mut client, STOP).unwrap();
    until(&mut client, GroupState::Standby);
}

/// A set-point that was stopped, or halted, is gone: neither standby nor the next
/// release goes on with it.
#[test]
fn a_stopped_set_point_is_not_gone_on_with() {
    const SET_POINT: u32 = 1;
    let mut client = in_standby(48);
    for axis in 1..=AXES {
        client.put(panel::MODE, axis, SET_POINT, 1).unwrap();
    }
    command(&mut client, SET_MODES).unwrap();
    client.listen(Time::from_ms(1000));
    until(&mut client, GroupState::Standby);
    for order in [STOP, HALT] {
        command(&mut client, RELEASE).unwrap();
        until(&mut client, GroupState::Moving);
        put_targets(&mut client, 60_000);
        command(&mut client, START).unwrap();
        client.listen(Time::from_ms(500));
        command(&mut client, order).unwrap();
        client.listen(Time::from_ms(1500));
        let rest = positions(&mut client);
        client.listen(Time::from_ms(1000));
        arrived(&mut client, &rest, 0);
        command(&mut client, RELEASE).unwrap();
        client.listen(Time::from_ms(1000));
        arrived(&mut client, &rest, 0);
        command(&mut client, STOP).unwrap();
        until(&mut client, GroupState::Standby);
    }
}

#[test]
fn what_a_drive_lacks_or_a_missing_one_forbids_is_refused() {
    let mut client = in_standby(43);
    // No drive has interpolated position mode.
    let done = client.put(panel::MODE, 3, 7, 1);
    refused(&mut client, done, AbortCode::VALUE_RANGE, 0x0306_0007);
    let done = client.put(panel::AXES, 0, 0x7F, 4);
    refused(&mut client, done, AbortCode::VALUE_RANGE, 0xFF08_007F);

    let mut client = crate::leader::client(Scenario::new(44, END).without(NodeId::constant::<3>()));
    client.listen(Time::from_ms(4000));
    assert_eq!(state(&mut client), GroupState::Idle as u32);
    for order in [RELEASE, RUN] {
        let done = command(&mut client, order);
        // Axis 3 is missing.
        refused(&mut client, done, AbortCode::DEVICE_STATE, 0x0304_0000);
    }
    assert!(
        !client
            .world
            .statuses()
            .flatten()
            .any(|status| enabled(&status))
    );
}

#[test]
fn the_group_is_followed_by_the_boards_own_tpdos() {
    let mut client = in_standby(45);
    client.listen(Time::from_ms(200));
    for id in [0x1FF, 0x2FF, 0x3FF, 0x4FF] {
        assert!(client.heard_from(id).is_empty(), "off");
    }
    for n in 0..4 {
        let id = client.number(0x1800 + n, 1).unwrap();
        assert_eq!(id & 0x8000_0000, 0x8000_0000);
        client.put(0x1800 + n, 2, 20, 1).unwrap();
        client.put(0x1800 + n, 1, id & 0x7FFF_FFFF, 4).unwrap();
    }
    client.take_heard();
    client.listen(Time::from_ms(2000));
    let heard = client.take_heard();
    let syncs = heard.iter().filter(|(_, frame)| frame.id() == CobId::SYNC);
    let expected = syncs.count() / 20;
    let of = |id: u16| -> Vec<Frame> {
        let all = heard.iter().map(|(_, frame)| *frame);
        all.filter(|frame| frame.id().get() == id).collect()
    };
    for id in [0x1FF, 0x2FF, 0x3FF, 0x4FF] {
        let count = of(id).len();
        assert!(
            count.abs_diff(expected) <= 1,
            "{id:X}h: {count} of {expected}"
        );
    }
    // State and step; positions of axes 1 and 2.
    let standby = GroupState::Standby as u8;
    assert!(
        of(0x1FF)
            .iter()
            .all(|frame| frame.data() == [standby, 0, 0])
    );
    let all = positions(&mut client);
    let mut bytes = all[0].to_le_bytes().to_vec();
    bytes.extend(all[1].to_le_bytes());
    let near = |frame: &Frame| {
        let data: [u8; 8] = frame.data().try_into().unwrap();
        let first = i32::from_le_bytes(data[..4].try_into().unwrap());
        let second = i32::from_le_bytes(data[4..].try_into().unwrap());
        (first - all[0]).abs() <= 2 && (second - all[1]).abs() <= 2
    };
    assert!(of(0x2FF).iter().all(near));
    // More often than the cycle has room for.
    let result = client.write(Address::new(0x1800, 2), &[0], Protocol::Normal);
    assert!(result.is_err());
}

/// What was read from 200Fh is a program: written again it runs; damaged it is refused.
#[test]
fn a_program_is_downloaded_by_block_and_segmented_transfer_and_run() {
    let mut client = in_standby(46);
    let program = Address::new(panel::PROGRAM, 0);
    let bytes = client.read(program, Protocol::Block).unwrap();
    assert!(bytes.len() > 100, "{}", bytes.len());
    let mut damaged = bytes.clone();
    damaged[20] ^= 1;
    for protocol in [Protocol::Block, Protocol::Normal] {
        let done = client.write(program, &damaged, protocol);
        assert!(
            matches!(done, Err(SdoError::Aborted { code, .. }) if code == AbortCode::VALUE_RANGE)
        );
        assert_eq!(
            client.number(panel::REFUSAL, 0).unwrap() >> 16,
            0xFF14,
            "checksum"
        );
        client.write(program, &bytes, protocol).unwrap();
        assert_eq!(client.read(program, protocol), Ok(bytes.clone()));
    }
    let long = vec![0; panel::PROGRAM_BYTES + 1];
    let done = client.write(program, &long, Protocol::Block);
    assert!(matches!(done, Err(SdoError::Aborted { code, .. }) if code == AbortCode::TOO_LONG));
    let another = compiled(
        "unit = \"turns\"\nvelocity = 1000\nacceleration = 2000\n\
         [[step]]\n[[step.move]]\naxes = [\"axis 2\"]\nto = 3\n",
    );
    client.write(program, &another, Protocol::Block).unwrap();
    assert_eq!(client.read(program, Protocol::Normal), Ok(another.clone()));
    let from = positions(&mut client);
    command(&mut client, RUN).unwrap();
    until(&mut client, GroupState::Moving);
    assert_eq!(client.number(panel::STEP, 0), Ok(1));
    // Not while it runs.
    let moving = 0xFF01_0000 | GroupState::Moving as u32;
    let done = client.write(program, &bytes, Protocol::Block);
    refused(&mut client, done, AbortCode::DEVICE_STATE, moving);
    until(&mut client, GroupState::Standby);
    for ((axis, from), now) in (1..).zip(&from).zip(positions(&mut client)) {
        let way = if axis == 2 { 6000 } else { 0 };
        assert!(
            (now - from - way).abs() <= 3,
            "axis {axis}: {now} from {from}"
        );
    }
}
