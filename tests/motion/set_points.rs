//! What a drive needs before its next set-point: velocity and ramps of profile position
//! mode.

use canmaster::motion::experiment::GROUP;
use canmaster::motion::mode::Mode;
use canmaster::motion::{
    AxisMove, DriveSetting, GroupEvent, GroupState, Inputs, Order, Reason, Refusal, Wanted,
};

use crate::rig::{ALL, AXES, READY, Rig, far};

/// Bit 4 of the controlword.
const BEGIN: u16 = 1 << 4;

fn ready() -> Rig {
    let mut rig = Rig::in_mode(3, Mode::ProfilePosition);
    rig.released();
    rig.arrive(20);
    rig
}

/// Another velocity and other ramps for each axis.
fn part(n: usize) -> AxisMove {
    AxisMove {
        target: far(n).target / 2,
        velocity: 300 + 10 * n as u32,
        acceleration: 700 + n as u32,
        deceleration: 900 - n as u32,
        set: 1,
    }
}

fn velocity(axis: usize, value: u32) -> Wanted {
    Wanted {
        axis,
        setting: DriveSetting::ProfileVelocity,
        value,
    }
}

fn begun(rig: &Rig) -> usize {
    let words = rig.commands.iter().map(|command| command.controlword);
    words.filter(|word| word & BEGIN != 0).count()
}

/// A set-point is given when the drive shows its velocity and has had its ramps, exactly
/// those of the move; to all axes of the move at once.
#[test]
fn a_set_point_waits_for_its_velocity_and_ramps() {
    let mut rig = ready();
    rig.confirms = false;
    rig.go(part);
    for n in 0..AXES {
        for _ in 0..30 {
            rig.step(READY);
            assert_eq!(begun(&rig), 0, "axis {n}");
        }
        let wanted = velocity(n, part(n).velocity);
        assert_eq!(rig.group.wanted(), Some(wanted));
        rig.drives[n].profile_velocity = part(n).velocity.into();
        rig.group.confirm(&wanted);
    }
    let together = (0..10).any(|_| {
        rig.step(READY);
        begun(&rig) == AXES
    });
    assert!(together, "{}", rig.last());
    for (n, command) in rig.commands.iter().enumerate() {
        let ramps = (command.acceleration, command.deceleration);
        let told = (part(n).acceleration, part(n).deceleration);
        assert_eq!(ramps, told, "axis {n}");
    }
    let mut fastest = [0.0f64; AXES];
    for _ in 0..200 {
        rig.step(READY);
        for (fastest, drive) in fastest.iter_mut().zip(&rig.drives) {
            *fastest = fastest.max(drive.velocity.abs());
        }
    }
    for (n, fastest) in fastest.into_iter().enumerate() {
        let off = fastest - f64::from(part(n).velocity);
        assert!(off.abs() < 10.0, "axis {n}: {off} rpm beside its velocity");
    }
    // The next one at the same velocity is not asked for it again.
    rig.arrive(2000);
    rig.go(|n| AxisMove {
        target: 0,
        ..part(n)
    });
    rig.arrive(2000);
    assert_eq!(rig.group.wanted(), None);
}

/// A drive that does not come to show the velocity: the move is refused, the group stays
/// released, and the next one is asked for anew.
#[test]
fn a_velocity_that_is_not_shown_refuses_the_move() {
    let mut rig = ready();
    rig.confirms = false;
    rig.go(part);
    for _ in 0..1010 {
        rig.step(READY);
        assert_eq!(begun(&rig), 0);
    }
    let why = Refusal::of(0, Reason::NotShown, part(0).velocity, 0);
    assert_eq!(rig.notices.last(), Some(&GroupEvent::MoveRefused(why)));
    assert_eq!(rig.group.state(), GroupState::Moving);
    // It is asked for no more, and the others can go on without it.
    assert_eq!(rig.group.wanted(), None);
    let parts = core::array::from_fn(part);
    assert_eq!(rig.director.go(&rig.group, 0b10, &parts, 0), Ok(()));
    rig.step(READY);
    rig.step(READY);
    let second = velocity(1, part(1).velocity);
    assert_eq!(rig.group.wanted(), Some(second));
    rig.group.confirm(&second);
    rig.arrive(2000);
    rig.confirms = true;
    rig.go(part);
    rig.arrive(2000);
    let home = rig.group.view(0).unwrap().home;
    let target = f64::from(home + part(0).target);
    assert!((rig.drives[0].position - target).abs() < 5.0);
}

/// An axis that is left out is told nothing, and keeps no move from the others.
#[test]
fn a_drive_that_is_absent_is_not_waited_for() {
    let without = Inputs {
        absent: 1 << 2,
        ..READY
    };
    let mut rig = Rig::in_mode(3, Mode::ProfilePosition);
    rig.silent[2] = true;
    for _ in 0..200 {
        rig.step(without);
    }
    assert_eq!(rig.group.state(), GroupState::Standby, "{}", rig.last());
    rig.order(Order::Release);
    for _ in 0..20 {
        rig.step(without);
    }
    rig.go(part);
    let moved = (0..2000).any(|_| {
        rig.step(without);
        rig.director.patience() == 0 && rig.group.all_arrived()
    });
    assert!(moved, "{}", rig.last());
    for n in (0..AXES).filter(|n| *n != 2) {
        let target = rig.group.view(n).unwrap().home + part(n).target;
        assert!((rig.drives[n].position - f64::from(target)).abs() < 5.0);
    }
}

/// What was being written when a stop came may have been taken or not: it is written
/// again, and nothing is asked for before.
#[test]
fn after_a_stop_the_velocity_is_unknown() {
    let mut rig = ready();
    rig.go(part);
    rig.arrive(2000);
    rig.confirms = false;
    rig.go(|n| AxisMove {
        velocity: 800,
        ..far(n)
    });
    rig.step(READY);
    let late = rig.group.wanted().unwrap();
    assert_eq!(late, velocity(0, 800));
    rig.order(Order::Stop);
    rig.step(READY);
    assert_eq!(rig.group.wanted(), None);
    // It is shown too late.
    rig.group.confirm(&late);
    rig.until(GroupState::Standby, 200);
    rig.order(Order::SetMode {
        axes: ALL,
        mode: Mode::CyclicPosition,
    });
    rig.confirms = true;
    rig.step(READY);
    rig.until(GroupState::Standby, 50);
    rig.order(Order::SetMode {
        axes: ALL,
        mode: Mode::ProfilePosition,
    });
    rig.step(READY);
    rig.until(GroupState::Standby, 50);
    rig.confirms = false;
    rig.released();
    rig.arrive(20);
    rig.go(part);
    rig.step(READY);
    assert_eq!(rig.group.wanted(), Some(velocity(0, 300)));
}

/// Where the drive halts by itself it gets the ramp of a stop, and other modes have room
/// for their position loop again.
#[test]
fn a_stop_and_another_mode_have_their_own_ramps() {
    let mut rig = ready();
    rig.go(part);
    for _ in 0..60 {
        rig.step(READY);
    }
    rig.order(Order::Stop);
    rig.step(READY);
    for (n, command) in rig.commands.iter().enumerate() {
        assert_eq!(command.deceleration, GROUP.stop_deceleration, "axis {n}");
    }
    rig.until(GroupState::Standby, 300);
    rig.order(Order::SetMode {
        axes: ALL,
        mode: Mode::ProfileVelocity,
    });
    rig.step(READY);
    rig.until(GroupState::Standby, 50);
    rig.step(READY);
    for (n, command) in rig.commands.iter().enumerate() {
        let ramps = (command.acceleration, command.deceleration);
        assert_eq!(ramps, (GROUP.ramp_min, GROUP.ramp_min), "axis {n}");
    }
}
