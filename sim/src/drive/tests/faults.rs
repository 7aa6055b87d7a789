//! What goes wrong: heartbeat loss, errors, bus trouble, dead drives.

use super::rig::{Rig, quick};
use crate::bus::{ErrorState, EventKind};
use crate::drive::cia402::State;
use crate::drive::{DriveFault, Identity, Spread};
use crate::time::Time;
use canmaster::nmt::State as Nmt;

/// Watches node 127 with 200 ms, enabled, at 1000 rpm, one heartbeat heard.
fn watching() -> Rig {
    let mut rig = Rig::booted(quick(1));
    rig.write(0x1016, 1, &(127u32 << 16 | 200).to_le_bytes())
        .unwrap();
    rig.enable();
    rig.target_velocity(1000);
    rig.run_ms(300);
    rig.log.clear();
    rig.send(0x77F, &[0x05]);
    rig
}

#[test]
fn watching_begins_with_the_first_heartbeat() {
    let mut rig = Rig::booted(quick(1));
    rig.write(0x1016, 1, &(127u32 << 16 | 200).to_le_bytes())
        .unwrap();
    rig.enable();
    rig.send(0x77F, &[0x00]);
    rig.run_ms(1000);
    assert_eq!(rig.state(), State::OperationEnabled);
}

#[test]
fn a_lost_heartbeat_stops_the_axis_and_only_a_communication_reset_helps() {
    let mut rig = watching();
    rig.run_ms(199);
    assert_eq!(rig.state(), State::OperationEnabled);
    rig.run_ms(3);
    assert_eq!(rig.state(), State::FaultReactionActive);
    assert_eq!(rig.drive().status().nmt, Nmt::PreOperational);
    assert_eq!(rig.sent(0x081), [[0x30, 0x81, 0x10, 0, 0, 0, 0, 0]]);
    rig.run_ms(30);
    assert!((600.0..900.0).contains(&rig.rpm()), "quick-stop ramp");
    rig.run_ms(200);
    assert_eq!((rig.state(), rig.rpm()), (State::Fault, 0.0));

    // The heartbeat comes back: nothing changes. A fault reset is ignored.
    rig.send(0x77F, &[0x05]);
    rig.controlword(0x0000);
    rig.controlword(0x0080);
    assert_eq!(rig.state(), State::Fault);
    rig.nmt(0x82);
    rig.run_ms(250);
    rig.log.clear();
    rig.controlword(0x0000);
    rig.controlword(0x0080);
    assert_eq!(rig.state(), State::SwitchOnDisabled);
    assert_eq!(rig.sent(0x081), [[0; 8]]);
    assert_eq!(rig.read(0x1003, 0), Ok(1), "the history stays");
    assert_eq!(rig.read(0x1003, 1), Ok(0x8130));
    assert_eq!(rig.read(0x603F, 0), Ok(0x8130));
}

#[test]
fn with_6007_disable_voltage_the_axis_coasts() {
    let mut rig = watching();
    rig.write(0x6007, 0, &[2, 0]).unwrap();
    rig.run_ms(200);
    assert_eq!(rig.state(), State::Fault);
    assert!(rig.rpm() > 800.0);
    assert_eq!(rig.drive().truth().torque, 0.0);
}

#[test]
fn error_behaviour_1029_says_where_to_go() {
    for (value, state) in [
        (0, Nmt::PreOperational),
        (1, Nmt::Operational),
        (2, Nmt::Stopped),
    ] {
        let mut rig = watching();
        rig.write(0x1029, 1, &[value]).unwrap();
        rig.run_ms(300);
        assert_eq!(rig.drive().status().nmt, state);
        assert_eq!(rig.drive().status().last_emcy, Some(0x8130));
    }
}

#[test]
fn reactions_by_class() {
    use State::*;
    // Code, register, state 20 ms later, and whether the axis is braked.
    for (code, register, state, braked) in [
        (0x2310, 0x02, Fault, false),
        (0x3210, 0x04, Fault, false),
        (0x8A88, 0x01, Fault, false),
        (0x8611, 0x80, FaultReactionActive, true),
        (0x6320, 0x01, FaultReactionActive, true),
        (0x6081, 0x01, FaultReactionActive, true),
        (0xFF01, 0x00, OperationEnabled, false),
    ] {
        let at = Time::from_ms(2000);
        let mut rig = Rig::booted(quick(1).with(DriveFault::Error {
            at,
            code,
            until: None,
        }));
        rig.enable();
        rig.target_velocity(1000);
        rig.run_until(at + Time::from_ms(20));
        let [low, high] = u16::to_le_bytes(code);
        assert_eq!(rig.sent(0x081), [[low, high, register, 0, 0, 0, 0, 0]]);
        assert_eq!(rig.state(), state, "{code:04X}");
        assert_eq!(rig.rpm() < 900.0, braked, "{code:04X}");
        let warning = rig.drive().status().statusword & 1 << 7 != 0;
        assert_eq!(warning, code == 0xFF01);
        rig.run_ms(300);
        if state != OperationEnabled {
            assert_eq!(rig.state(), Fault);
            rig.controlword(0x0080);
            assert_eq!(rig.state(), SwitchOnDisabled);
            assert_eq!(rig.sent(0x081).last().unwrap(), &[0; 8]);
            assert_eq!(rig.read(0x1001, 0), Ok(0));
        }
    }
}

#[test]
fn a_fault_is_not_reset_while_its_cause_lasts() {
    let mut rig = Rig::booted(quick(1).with(DriveFault::Error {
        at: Time::from_ms(1000),
        code: 0x3220,
        until: Some(Time::from_ms(2000)),
    }));
    rig.run_until(Time::from_ms(1500));
    rig.controlword(0x0080);
    assert_eq!(rig.state(), State::Fault);
    rig.run_until(Time::from_ms(2001));
    rig.controlword(0x0000);
    rig.controlword(0x0080);
    assert_eq!(rig.state(), State::SwitchOnDisabled);
}

#[test]
fn a_warning_ends_with_its_cause() {
    let mut rig = Rig::booted(quick(1).with(DriveFault::Error {
        at: Time::from_ms(1000),
        code: 0xFF01,
        until: Some(Time::from_ms(1100)),
    }));
    rig.run_ms(1000);
    assert_eq!(rig.sent(0x081), [[0x01, 0xFF, 0, 0, 0, 0, 0, 0], [0; 8]]);
}

#[test]
fn no_emcy_in_stopped() {
    let mut rig = Rig::booted(quick(1).with(DriveFault::Error {
        at: Time::from_ms(1000),
        code: 0x2310,
        until: None,
    }));
    rig.nmt(0x02);
    rig.run_ms(1000);
    assert!(rig.log.is_empty());
    assert_eq!(rig.state(), State::Fault);
}

fn counters(state: ErrorState) -> EventKind {
    EventKind::Counters {
        tec: 0,
        rec: 0,
        state,
    }
}

#[test]
fn error_passive_is_8120() {
    let mut rig = watching();
    rig.tell(counters(ErrorState::Warning));
    assert_eq!(rig.state(), State::OperationEnabled);
    rig.tell(counters(ErrorState::Passive));
    assert_eq!(rig.state(), State::FaultReactionActive);
    assert_eq!(rig.drive().status().nmt, Nmt::PreOperational);
    rig.run_ms(300);
    assert_eq!(rig.sent(0x081)[0], [0x20, 0x81, 0x10, 0, 0, 0, 0, 0]);
}

#[test]
fn bus_off_takes_the_drive_off_the_bus_for_a_while() {
    let mut rig = watching();
    rig.tell(counters(ErrorState::BusOff));
    assert_eq!(rig.drive().timing(), None);
    assert_eq!(rig.drive().offer(), None);
    rig.run_ms(95);
    assert!(rig.log.is_empty());
    rig.run_ms(10);
    assert!(rig.drive().timing().is_some());
    assert_eq!(rig.sent(0x081), [[0xFD, 0x81, 0x10, 0, 0, 0, 0, 0]]);
}

#[test]
fn a_drive_without_power_is_silent_and_coasts() {
    let at = Time::from_ms(2000);
    let mut rig = Rig::booted(quick(1).with(DriveFault::PowerLoss { at }));
    rig.write(0x1017, 0, &10u16.to_le_bytes()).unwrap();
    rig.enable();
    rig.target_velocity(1000);
    rig.run_until(at);
    rig.log.clear();
    rig.run_ms(10_000);
    assert!(rig.log.is_empty());
    assert_eq!(rig.drive().timing(), None);
    assert_eq!(rig.rpm(), 0.0);
    let moved = rig.drive().status().moved_at.unwrap().since(at);
    assert!(moved > Time::from_ms(500), "nothing brakes but friction");
}

#[test]
fn a_power_cycle_ends_in_a_new_boot_up_with_nothing_configured() {
    let mut rig = Rig::booted(quick(1).with(DriveFault::PowerCycle {
        off: Time::from_ms(1500),
        on: Time::from_ms(2500),
    }));
    rig.write(0x1017, 0, &10u16.to_le_bytes()).unwrap();
    rig.enable();
    rig.run_until(Time::from_ms(1501));
    rig.log.clear();
    rig.run_until(Time::from_ms(3500));
    let frames: Vec<_> = rig.log.iter().map(|(_, f)| f.data().to_vec()).collect();
    assert_eq!(frames, [[0x00]]);
    assert!(rig.log[0].0 > Time::from_ms(2650));
    assert_eq!(rig.state(), State::SwitchOnDisabled);
}

#[test]
fn heartbeat_tpdos_and_sdo_can_be_lost_one_by_one() {
    let at = Time::from_ms(1500);
    for fault in [
        DriveFault::HeartbeatLost { at },
        DriveFault::TpdosLost { at },
        DriveFault::SdoDead { at },
    ] {
        let mut rig = Rig::booted(quick(1).with(fault));
        rig.write(0x1017, 0, &10u16.to_le_bytes()).unwrap();
        rig.write(0x1800, 2, &[1]).unwrap();
        rig.nmt(0x01);
        rig.run_until(at + Time::from_ms(15));
        rig.log.clear();
        rig.send(0x080, &[]);
        let answered = rig.sdo([0x40, 0, 0x10, 0, 0, 0, 0, 0]).is_some();
        let seen = (
            !rig.sent(0x701).is_empty(),
            !rig.sent(0x181).is_empty(),
            answered,
        );
        let expected = match fault {
            DriveFault::HeartbeatLost { .. } => (false, true, true),
            DriveFault::TpdosLost { .. } => (true, false, true),
            _ => (true, true, false),
        };
        assert_eq!(seen, expected, "{fault:?}");
    }
}

#[test]
fn another_device_and_slow_answers() {
    let other = Identity {
        product: 0x6050_0000,
        ..Identity::epos4(7)
    };
    let mut rig = Rig::booted(
        quick(1)
            .with(DriveFault::Identity(other))
            .with(DriveFault::SdoLatency(Spread::fixed(15_000))),
    );
    let at = rig.now;
    assert_eq!(rig.read(0x1018, 2), Ok(0x6050_0000));
    assert!(rig.log[0].0.since(at) >= Time::from_us(14_990));
}

#[test]
fn an_error_in_the_fault_state_is_told_too() {
    let error = |ms, code| DriveFault::Error {
        at: Time::from_ms(ms),
        code,
        until: None,
    };
    let mut rig = Rig::booted(quick(1).with(error(1000, 0x2310)).with(error(1100, 0x4210)));
    rig.run_ms(1000);
    assert_eq!(
        rig.sent(0x081),
        [
            [0x10, 0x23, 0x02, 0, 0, 0, 0, 0],
            [0x10, 0x42, 0x0A, 0, 0, 0, 0, 0]
        ]
    );
    assert_eq!(rig.drive().status().errors, [0x4210, 0x2310]);
}
