//! Something comes in between while a mode is changed: nothing moves, and before the axes
//! are enabled again 6061h has shown in which mode each of them is.

use canmaster::motion::mode::Mode;
use canmaster::motion::{Cause, GroupEvent, GroupState, Inputs, Order};

use crate::rig::{ALL, AXES, READY, Rig};

use GroupState::*;

const FAULT: Inputs = Inputs {
    fault: Some((0, Cause::HeartbeatLost.alone())),
    ..READY
};

/// Before, in and after the change of its drive.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Written {
    Never,
    Before,
    Later,
}

/// Changes from one mode to another until `end` comes in between, and enables again.
/// At most so far from where it was the axis ever is.
fn interrupted(from: Mode, to: Mode, written: Written, end: fn(&mut Rig)) -> Rig {
    let what = format!("{from} to {to}, {written:?}");
    let mut rig = match from {
        Mode::ProfileVelocity => Rig::standby(1),
        from => Rig::in_mode(1, from),
    };
    rig.confirms = false;
    rig.order(Order::SetMode {
        axes: ALL,
        mode: to,
    });
    (0..6).for_each(|_| rig.step(READY));
    assert_eq!(rig.group.state(), ModeChange, "{what}");
    let set = |rig: &mut Rig| rig.drives.iter_mut().for_each(|drive| drive.set_mode(to));
    if written == Written::Before {
        set(&mut rig);
        rig.step(READY);
    }
    rig.observe_anew();
    end(&mut rig);
    if written == Written::Later {
        set(&mut rig);
    }
    let came = (0..500).any(|_| {
        rig.step(READY);
        for (command, drive) in rig.commands.iter().zip(&rig.drives) {
            let torque = command.mode == Mode::CyclicTorque && command.target != 0;
            assert!(!torque, "{what}: torque of {}", command.target);
            let far = f64::from(command.target) - drive.position;
            let away = command.mode == Mode::CyclicPosition && far.abs() > 5.0;
            assert!(!away, "{what}: target {far} away");
        }
        matches!(rig.group.state(), Idle | Faulted)
    });
    assert!(came, "{what}: {}", rig.last());
    for seen in &rig.observed {
        assert!(seen.highest - seen.lowest < 5.0, "{what}: it moved");
    }
    match rig.group.state() {
        Idle => rig.order(Order::Enable),
        _ => rig.order(Order::Reset),
    }
    // Not without the mode.
    (0..50).for_each(|_| rig.step(READY));
    assert_eq!(rig.group.state(), Enabling, "{what}: {}", rig.last());
    rig.confirms = true;
    rig.until(Standby, 100);
    for n in 0..AXES {
        assert_eq!(rig.drives[n].mode, to, "{what}");
        assert_eq!(rig.group.view(n).unwrap().mode, to, "{what}");
    }
    for _ in 0..50 {
        rig.step(READY);
        for command in &rig.commands {
            assert_eq!(command.mode, to, "{what}: another RPDO");
        }
    }
    assert_eq!(rig.group.state(), Standby, "{what}: {}", rig.last());
    rig
}

#[test]
fn a_mode_change_that_is_interrupted_is_finished_when_the_axes_are_enabled() {
    let fault: fn(&mut Rig) = |rig| rig.step(FAULT);
    let quick_stop: fn(&mut Rig) = |rig| {
        rig.order(Order::QuickStop);
        rig.step(READY);
    };
    for end in [fault, quick_stop] {
        for from in Mode::ALL {
            for to in Mode::ALL {
                if from == to {
                    continue;
                }
                for written in [Written::Never, Written::Before, Written::Later] {
                    interrupted(from, to, written, end);
                }
            }
        }
    }
}

/// A drive that was switched off has the mode of its configuration again.
#[test]
fn a_mode_is_asked_for_again_after_a_fault() {
    let mut rig = Rig::in_mode(1, Mode::CyclicPosition);
    rig.step(FAULT);
    rig.until(Faulted, 300);
    rig.drives[2].set_mode(Mode::ProfileVelocity);
    rig.order(Order::Reset);
    rig.until(Standby, 100);
    assert!(rig.drives.iter().all(|d| d.mode == Mode::CyclicPosition));
    rig.released();
    rig.go(crate::rig::far);
    rig.arrive(2000);
}

#[test]
fn a_mode_that_stays_unknown_is_a_fault_that_names_it() {
    let mut rig = Rig::in_mode(1, Mode::CyclicPosition);
    rig.step(FAULT);
    rig.until(Faulted, 300);
    rig.confirms = false;
    rig.order(Order::Reset);
    rig.until(FaultStop, 300);
    let cause = Cause::ModeNotConfirmed.with(Mode::CyclicPosition as i32);
    let axis = Some(0);
    assert!(rig.events.contains(&GroupEvent::Fault { axis, cause }));
    rig.until(Faulted, 300);
}
