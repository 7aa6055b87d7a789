//! A stop is never lost: in whatever state it comes, the program is over, and nothing
//! moves before the next release.

use canmaster::motion::mode::Mode;
use canmaster::motion::{GroupEvent, GroupState, Order, format};

use crate::compiled::compiled;
use crate::programs::{program, wait};
use crate::rig::{ALL, AXES, READY, Rig};

use GroupState::*;

/// Home, another mode and a move: every kind of step that goes through standby.
fn homing_run() -> Vec<u8> {
    let text = "velocity = 600\nacceleration = 4000\n[[step]]\n[step.home]\n\
        [[step]]\n[step.mode]\nis = \"cyclic synchronous position\"\n\
        [[step]]\n[[step.move]]\nto = 1500";
    compiled(text).bytes()
}

/// What somebody does to stop it.
type Stops = fn(&mut Rig);

/// Cycles that the run takes, and then some.
const COURSE: u32 = 150;

fn begun() -> Rig {
    let mut rig = Rig::standby(1);
    rig.program = homing_run();
    rig.run();
    rig
}

/// The button as the board has it: a stop where the group moves, else a press.
fn press(rig: &mut Rig) {
    if matches!(rig.group.state(), Moving | Homing | ModeChange) {
        rig.order(Order::Stop);
    } else {
        rig.director.press(&mut rig.group);
    }
}

/// Nothing is released, and nothing turns once the group stands by.
fn comes_to_nothing(rig: &mut Rig, what: &str) {
    let before = rig.states().len();
    let came = (0..200).any(|_| {
        rig.step(READY);
        rig.group.state() == Standby && rig.standing()
    });
    assert!(came, "{what}: {}", rig.last());
    let places = rig.drives.each_ref().map(|drive| drive.position);
    for _ in 0..COURSE {
        rig.step(READY);
        assert_eq!(rig.group.state(), Standby, "{what}: {}", rig.last());
    }
    for (n, place) in places.into_iter().enumerate() {
        let moved = (rig.drives[n].position - place).abs();
        assert!(moved < 3.0, "{what}: axis {n} moved by {moved}");
    }
    let after = &rig.states()[before..];
    assert!(!after.contains(&Homing), "{what}: {after:?}");
    assert!(!after.contains(&Moving), "{what}: {after:?}");
    assert_eq!(rig.director.step(), 0, "{what}");
    let done = rig.notices.contains(&GroupEvent::ProgramDone);
    assert!(!done, "{what}");
}

#[test]
fn a_stop_in_any_cycle_of_a_program_ends_it() {
    let stop = |rig: &mut Rig| rig.order(Order::Stop);
    let off_and_on = |rig: &mut Rig| {
        rig.order(Order::Disable);
        rig.step(READY);
        rig.order(Order::Enable);
    };
    let kinds: [(&str, Stops); 3] = [("stop", stop), ("button", press), ("disable", off_and_on)];
    for (name, order) in kinds {
        let mut seen = Vec::new();
        for cycle in 1..COURSE {
            let mut rig = begun();
            (0..cycle).for_each(|_| rig.step(READY));
            if rig.director.step() == 0 && cycle > 1 {
                break;
            }
            seen.push(rig.group.state());
            order(&mut rig);
            comes_to_nothing(&mut rig, &format!("{name} in cycle {cycle}"));
        }
        for state in [Standby, Moving, Homing, ModeChange] {
            assert!(seen.contains(&state), "{name}: {seen:?}");
        }
    }
}

/// The next release begins the program anew.
#[test]
fn after_a_stop_while_modes_change_the_program_begins_anew() {
    let mut rig = begun();
    rig.confirms = false;
    rig.until(ModeChange, 20);
    rig.order(Order::Stop);
    rig.confirms = true;
    rig.until(Standby, 50);
    (0..20).for_each(|_| rig.step(READY));
    assert_eq!((rig.group.state(), rig.director.step()), (Standby, 0));
    rig.run();
    (0..400).for_each(|_| rig.step(READY));
    assert!(rig.notices.contains(&GroupEvent::ProgramDone));
    assert_eq!(rig.drives[0].mode, Mode::CyclicPosition);
}

/// A release in standby between two steps does no more than that of the program.
#[test]
fn a_release_in_any_cycle_of_a_program_changes_nothing() {
    for cycle in 1..COURSE {
        let mut rig = begun();
        (0..cycle).for_each(|_| rig.step(READY));
        let _ = rig.group.order(Order::Release);
        (0..2 * COURSE).for_each(|_| rig.step(READY));
        let running = !rig.notices.contains(&GroupEvent::ProgramDone);
        assert!(!running, "cycle {cycle}: {}", rig.last());
        for n in 0..AXES {
            assert!((rig.drives[n].position - 1500.0).abs() < 5.0, "{cycle}");
        }
    }
}

/// A program that runs is not begun again in the standby between two of its steps.
#[test]
fn a_program_that_runs_is_not_begun_again() {
    for cycle in 1..COURSE {
        let mut rig = begun();
        (0..cycle).for_each(|_| rig.step(READY));
        if rig.director.step() != 0 {
            assert!(rig.director.run(&mut rig.group).is_err(), "cycle {cycle}");
        }
    }
}

/// The number of a step is as wide in the log as in 2010h.
#[test]
fn steps_are_counted_beyond_255() {
    let mut rig = Rig::standby(1);
    rig.program = program(&vec![wait(1); 300]);
    assert_eq!(
        format::check(&rig.program, &canmaster::motion::experiment::GROUP),
        Ok(())
    );
    rig.run();
    (0..1000).for_each(|_| rig.step(READY));
    let last = rig.notices.iter().rev().find_map(|notice| match notice {
        GroupEvent::StepStarted { step } => Some(u32::from(*step)),
        _ => None,
    });
    assert_eq!(last, Some(299));
}

/// What a client orders while a search for home waits for its step does not begin.
#[test]
fn a_move_and_a_search_for_home_exclude_each_other() {
    let mut rig = Rig::in_mode(1, Mode::Homing);
    rig.order(Order::SetMode {
        axes: 1,
        mode: Mode::ProfileVelocity,
    });
    rig.step(READY);
    rig.until(Standby, 50);
    rig.released();
    let home = Order::Home {
        axes: ALL & !1,
        limit: 300,
    };
    let parts = core::array::from_fn(crate::rig::far);
    rig.director.go(&rig.group, 1, &parts, 0).unwrap();
    rig.step(READY);
    assert!(rig.group.order(home).is_err(), "an axis moves");
    rig.order(Order::Stop);
    rig.step(READY);
    rig.until(Standby, 300);
    rig.released();
    rig.order(home);
    let start = rig.group.count() + 1;
    assert!(rig.group.announce(start, 1).is_err(), "home is ordered");
    rig.until(Standby, 300);
    assert_eq!(rig.notices, []);
}
