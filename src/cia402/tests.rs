//! The tables of CiA 402-2, and the axis against a drive that obeys them.

use super::*;
use crate::time::{Duration, Instant};
use std::vec::Vec;

const TIMEOUT: Duration = Duration::from_millis(500);

fn ms(ms: u64) -> Instant {
    Instant::from_micros(ms * 1000)
}

/// The table of state coding, bits x of the profile filled both ways.
#[test]
fn state_coding() {
    let table = [
        (0x0000, State::NotReadyToSwitchOn),
        (0x0020, State::NotReadyToSwitchOn),
        (0x0240, State::SwitchOnDisabled),
        (0x0060, State::SwitchOnDisabled),
        (0x0231, State::ReadyToSwitchOn),
        (0x0233, State::SwitchedOn),
        (0x1637, State::OperationEnabled),
        (0x0217, State::QuickStopActive),
        (0x021F, State::FaultReactionActive),
        (0x023F, State::FaultReactionActive),
        (0x0208, State::Fault),
        (0x0228, State::Fault),
        (0x0201, State::Other(0x01)),
        (0x0007 | 0x40, State::Other(0x47)),
    ];
    for (word, state) in table {
        assert_eq!(StatusWord(word).state(), state, "{word:#06x}");
    }
}

#[test]
fn every_statusword_survives() {
    for word in 0..=u16::MAX {
        let state = StatusWord(word).state();
        assert_eq!(StatusWord(state.bits()).state(), state, "{word:#06x}");
        if let State::Other(bits) = state {
            assert_eq!(u16::from(bits), word & 0x6F);
        }
    }
}

/// The table of command coding, and the bits that belong to the mode.
#[test]
fn command_coding() {
    let table = [
        (Command::Shutdown, 0x0006),
        (Command::SwitchOn, 0x0007),
        (Command::DisableOperation, 0x0007),
        (Command::EnableOperation, 0x000F),
        (Command::DisableVoltage, 0x0000),
        (Command::QuickStop, 0x0002),
        (Command::FaultReset, 0x0080),
    ];
    for (command, word) in table {
        assert_eq!(ControlWord::new(command).0, word);
        assert_eq!(ControlWord(0xFFFF).with(command).0, 0xFF70 | word);
        assert!(ControlWord(word).gives(command));
    }
    assert!(ControlWord(0x0100).with_halt(true).halt());
    assert_eq!(ControlWord(0x010F).with_halt(false).0, 0x000F);
}

#[test]
fn enabling_waits_for_each_state() {
    let mut axis = Axis::new();
    axis.set_goal(Goal::Enabled, ms(0));
    let chart = [
        (0x0000, 0x0000), // not ready: wait
        (0x0240, 0x0006), // disabled: shutdown
        (0x0240, 0x0006),
        (0x0231, 0x0007),
        (0x0233, 0x000F),
        (0x0237, 0x000F),
    ];
    for (status, control) in chart {
        assert!(!axis.reached());
        assert_eq!(axis.step(ms(1), Some(StatusWord(status))).0, control);
    }
    assert!(axis.reached());
    assert_eq!(axis.check(ms(10_000), TIMEOUT), Ok(()));
}

#[test]
fn a_stale_statusword_is_not_judged() {
    let mut axis = Axis::new();
    axis.set_goal(Goal::Ready, ms(0));
    axis.step(ms(0), Some(StatusWord(0x0231)));
    assert!(axis.reached());
    axis.set_goal(Goal::Enabled, ms(10));
    assert_eq!(axis.state(), None);
    // Nothing heard: the word stays, and the timeout says that nothing was heard.
    assert_eq!(axis.step(ms(20), None).0, 0x0006);
    let timeout = axis.check(ms(511), TIMEOUT).unwrap_err();
    assert_eq!(timeout.state, None);
    assert_eq!(timeout.goal, Goal::Enabled);
}

#[test]
fn a_timeout_names_the_state() {
    let mut axis = Axis::new();
    axis.set_goal(Goal::SwitchedOn, ms(0));
    axis.step(ms(400), Some(StatusWord(0x0231)));
    assert_eq!(axis.check(ms(500), TIMEOUT), Ok(()));
    let timeout = axis.check(ms(501), TIMEOUT).unwrap_err();
    assert_eq!(
        std::format!("{timeout}"),
        "stayed in \"ready to switch on\" instead of \"switched on\""
    );
}

/// Bit 7: low for a controlword, high until the fault is gone, then low; and a
/// new edge if the fault stays.
#[test]
fn fault_reset_is_a_clean_edge() {
    let mut axis = Axis::new();
    axis.step(ms(0), Some(StatusWord(0x0237)));
    axis.set_goal(Goal::Ready, ms(0));
    let fault = Some(StatusWord(0x0208));
    let words: Vec<u16> = (0..25).map(|i| axis.step(ms(i * 10), fault).0).collect();
    assert_eq!(words[0], 0x0000);
    assert!(words[1..21].iter().all(|w| *w == 0x0080), "{words:x?}");
    assert_eq!(words[21..23], [0x0000, 0x0080], "{words:x?}");
    assert_eq!(axis.step(ms(300), Some(StatusWord(0x0240))).0, 0x0006);
}

/// Every defined state to every goal, with a drive that obeys the profile's
/// transitions: the goal is reached and operation is never enabled on the way
/// to any other goal.
#[test]
fn every_goal_from_every_state() {
    let states = [
        State::NotReadyToSwitchOn,
        State::SwitchOnDisabled,
        State::ReadyToSwitchOn,
        State::SwitchedOn,
        State::OperationEnabled,
        State::QuickStopActive,
        State::FaultReactionActive,
        State::Fault,
    ];
    let goals = [
        Goal::Disabled,
        Goal::Ready,
        Goal::SwitchedOn,
        Goal::Enabled,
        Goal::QuickStop,
    ];
    for start in states {
        for goal in goals {
            let mut drive = Obedient {
                state: start,
                word: ControlWord(0),
            };
            let mut axis = Axis::new();
            axis.set_goal(goal, ms(0));
            for cycle in 0..12 {
                let word = axis.step(ms(cycle), Some(StatusWord(drive.state.bits())));
                let before = drive.state;
                drive.take(word);
                let enabled_now = drive.state == State::OperationEnabled && before != drive.state;
                assert!(!enabled_now || goal == Goal::Enabled, "{start} {goal}");
            }
            let cannot = goal == Goal::QuickStop && start.is_fault();
            assert_eq!(axis.reached(), !cannot, "{start} -> {goal}");
        }
    }
}

/// The transitions of CiA 402-2, figure of the state machine.
struct Obedient {
    state: State,
    word: ControlWord,
}

impl Obedient {
    fn take(&mut self, word: ControlWord) {
        use Command::*;
        use State::*;
        let edge = word.gives(FaultReset) && !self.word.gives(FaultReset);
        self.word = word;
        self.state = match self.state {
            NotReadyToSwitchOn => SwitchOnDisabled,
            FaultReactionActive => Fault,
            Fault if edge => SwitchOnDisabled,
            SwitchOnDisabled if word.gives(Shutdown) => ReadyToSwitchOn,
            ReadyToSwitchOn if word.gives(SwitchOn) => SwitchedOn,
            ReadyToSwitchOn if word.gives(DisableVoltage) => SwitchOnDisabled,
            ReadyToSwitchOn if word.gives(QuickStop) => SwitchOnDisabled,
            SwitchedOn if word.gives(EnableOperation) => OperationEnabled,
            SwitchedOn if word.gives(Shutdown) => ReadyToSwitchOn,
            SwitchedOn if word.gives(DisableVoltage) => SwitchOnDisabled,
            SwitchedOn if word.gives(QuickStop) => SwitchOnDisabled,
            OperationEnabled if word.gives(DisableOperation) => SwitchedOn,
            OperationEnabled if word.gives(Shutdown) => ReadyToSwitchOn,
            OperationEnabled if word.gives(DisableVoltage) => SwitchOnDisabled,
            OperationEnabled if word.gives(QuickStop) => QuickStopActive,
            QuickStopActive if word.gives(DisableVoltage) => SwitchOnDisabled,
            other => other,
        };
    }
}
