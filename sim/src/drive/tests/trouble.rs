//! What is wrong in one state of CiA 402, and a shaft that is blocked.

use super::rig::{Rig, quick};
use crate::drive::cia402::State;
use crate::drive::{DriveFault, Spread, Trouble};
use crate::time::Time;
use State::{
    Fault, OperationEnabled, QuickStopActive, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn,
};

/// A state, the controlwords that lead there, the next one, and where that leads.
type Way = (State, &'static [u16], u16, State);

const WAYS: [Way; 5] = [
    (SwitchOnDisabled, &[], 0x06, ReadyToSwitchOn),
    (ReadyToSwitchOn, &[0x06], 0x07, SwitchedOn),
    (SwitchedOn, &[0x06, 0x07], 0x0F, OperationEnabled),
    (
        OperationEnabled,
        &[0x06, 0x07, 0x0F],
        0x00,
        SwitchOnDisabled,
    ),
    (
        QuickStopActive,
        &[0x06, 0x07, 0x0F, 0x02],
        0x00,
        SwitchOnDisabled,
    ),
];

/// A drive that was led to `state` and has this trouble there.
fn led(state: State, words: &[u16], what: Trouble) -> Rig {
    let mut rig = Rig::booted(quick(1));
    rig.write(0x6060, 0, &[3]).unwrap();
    rig.nmt(0x01);
    for word in words {
        rig.controlword(*word);
    }
    rig.drives[0].inject(DriveFault::InState { state, what });
    rig
}

#[test]
fn what_is_wrong_in_a_state_comes_each_time_that_it_is_entered() {
    let (state, what) = (OperationEnabled, Trouble::DropsOut { after_us: 30_000 });
    let mut rig = Rig::booted(quick(1).with(DriveFault::InState { state, what }));
    for _ in 0..2 {
        rig.controlword(0x06);
        rig.controlword(0x0F);
        assert_eq!(rig.state(), OperationEnabled);
        rig.run_ms(20);
        assert_eq!(rig.state(), SwitchOnDisabled);
    }
}

#[test]
fn a_deaf_drive_never_confirms() {
    for (state, words, next, _) in WAYS {
        let mut rig = led(state, words, Trouble::Deaf);
        assert_eq!(rig.state(), state);
        rig.controlword(next);
        rig.run_ms(3000);
        assert_eq!(rig.state(), state);
        assert!(rig.sent(0x081).is_empty());
    }
}

#[test]
fn a_fault_that_is_never_reset() {
    let mut rig = led(Fault, &[0x06], Trouble::Deaf);
    let (at, code, until) = (rig.now, 0x2310, None);
    rig.drives[0].inject(DriveFault::Error { at, code, until });
    rig.run_ms(5);
    for word in [0x00, 0x80] {
        rig.controlword(word);
    }
    rig.run_ms(1000);
    assert_eq!(rig.state(), Fault);
}

#[test]
fn a_slow_drive_confirms_late() {
    for (state, words, next, after) in WAYS {
        let mut rig = led(state, words, Trouble::Slow(Spread::fixed(300_000)));
        rig.controlword(next);
        rig.run_ms(250);
        assert_eq!(rig.state(), state);
        rig.run_ms(100);
        assert_eq!(rig.state(), after);
    }
}

/// CiA 402-2, transitions 7, 9, 10 and 12: no error, no message.
#[test]
fn a_drive_drops_out_of_each_state() {
    for (state, words, ..) in &WAYS[1..] {
        let mut rig = led(*state, words, Trouble::DropsOut { after_us: 50_000 });
        assert_eq!(rig.state(), *state);
        rig.run_ms(60);
        assert_eq!(rig.state(), SwitchOnDisabled);
        assert!(rig.sent(0x081).is_empty());
        assert!(!rig.drive().axis.powered());
    }
}

#[test]
fn an_axis_that_drops_out_in_motion_coasts() {
    let mut rig = Rig::booted(quick(1));
    rig.enable();
    rig.target_velocity(1000);
    rig.run_ms(300);
    let (state, what) = (OperationEnabled, Trouble::DropsOut { after_us: 0 });
    rig.drives[0].inject(DriveFault::InState { state, what });
    rig.run_ms(20);
    assert_eq!(rig.state(), SwitchOnDisabled);
    assert!(rig.rpm() > 900.0);
}

#[test]
fn an_error_comes_in_each_state() {
    for (state, words, ..) in WAYS {
        let (after_us, code) = (50_000, 0x3210);
        let mut rig = led(state, words, Trouble::Error { after_us, code });
        rig.run_ms(60);
        assert_eq!(rig.state(), Fault, "{state:?}");
        assert_eq!(rig.sent(0x081)[0][..2], [0x10, 0x32]);
    }
}

#[test]
fn the_supply_fails_in_each_state() {
    for (state, words, ..) in WAYS {
        let mut rig = led(state, words, Trouble::PowerLoss { after_us: 50_000 });
        rig.run_ms(60);
        assert_eq!(rig.drive().timing(), None, "{state:?}");
        assert!(rig.sent(0x081).is_empty());
    }
}

fn block(rig: &mut Rig, until: Option<Time>) {
    let at = rig.now;
    rig.drives[0].inject(DriveFault::Blocked { at, until });
}

/// In profile velocity the drive has no position to miss: it only pushes.
#[test]
fn a_blocked_axis_in_profile_velocity_goes_on_when_it_is_free() {
    let mut rig = Rig::booted(quick(1));
    rig.enable();
    rig.target_velocity(500);
    rig.run_ms(300);
    let until = rig.now + Time::from_ms(200);
    block(&mut rig, Some(until));
    rig.run_ms(150);
    assert_eq!((rig.rpm(), rig.state()), (0.0, OperationEnabled));
    assert!(rig.drive().truth().torque > 1.0, "at its largest torque");
    rig.run_ms(500);
    assert!((rig.rpm() - 500.0).abs() < 20.0, "{}", rig.rpm());
    assert!(rig.sent(0x081).is_empty());
}

/// In profile position it is a following error (6065h, 8611h, bit 13).
#[test]
fn a_blocked_axis_in_profile_position_is_a_following_error() {
    let mut rig = Rig::booted(quick(1));
    rig.enable_in(1);
    rig.write32(0x607A, 0, 100_000);
    rig.controlword(0x1F);
    rig.run_ms(200);
    block(&mut rig, None);
    rig.run_ms(200);
    assert_eq!(rig.sent(0x081), [[0x11, 0x86, 0x80, 0, 0, 0, 0, 0]]);
    assert_eq!(rig.bits(1 << 13), 1 << 13);
    rig.run_ms(1500);
    assert_eq!(rig.state(), Fault);
}

/// A search for a hard stop takes whatever blocks the axis for it.
#[test]
fn homing_to_a_stop_ends_at_what_blocks_the_axis() {
    let mut rig = Rig::booted(quick(1));
    rig.write(0x6098, 0, &[(-3_i8) as u8]).unwrap();
    rig.enable_in(6);
    rig.controlword(0x1F);
    rig.run_ms(500);
    block(&mut rig, None);
    rig.run_ms(1000);
    let attained = (1 << 12) | (1 << 10) | (1 << 15);
    assert_eq!(rig.bits(attained | 1 << 13), attained);
    assert!(rig.position().abs() <= 1);
}
