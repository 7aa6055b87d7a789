//! Every state, command and reaction.

use super::*;

const OPTIONS: Options = Options {
    shutdown: 0,
    disable_operation: 1,
    fault_reaction: 2,
    abort_connection: 3,
};
const STATES: [State; 8] = [
    State::NotReadyToSwitchOn,
    State::SwitchOnDisabled,
    State::ReadyToSwitchOn,
    State::SwitchedOn,
    State::OperationEnabled,
    State::QuickStopActive,
    State::FaultReactionActive,
    State::Fault,
];

fn machine(state: State) -> Machine {
    Machine {
        state,
        controlword: 0,
        leaving: None,
    }
}

#[test]
fn every_controlword_is_one_command_of_the_table() {
    // mask, value: CiA 402-2, commands in the controlword.
    let table = [
        (Command::Shutdown, 0x87, 0x06),
        (Command::SwitchOn, 0x8F, 0x07),
        (Command::EnableOperation, 0x8F, 0x0F),
        (Command::DisableVoltage, 0x82, 0x00),
        (Command::QuickStop, 0x86, 0x02),
        (Command::FaultReset, 0x80, 0x80),
    ];
    for controlword in 0..=u16::MAX {
        let matching: Vec<_> = table
            .iter()
            .filter(|(_, mask, value)| controlword & mask == *value)
            .collect();
        assert_eq!(matching.len(), 1);
        assert_eq!(Command::decode(controlword), matching[0].0);
    }
}

#[test]
fn every_state_and_every_command() {
    use State::*;
    // Rows: states as in STATES. Columns: shutdown, switch on, enable,
    // disable voltage, quick stop, fault reset; the state after the command
    // once a ramp has ended.
    let table = [
        [NotReadyToSwitchOn; 6],
        [
            ReadyToSwitchOn,
            SwitchOnDisabled,
            SwitchOnDisabled,
            SwitchOnDisabled,
            SwitchOnDisabled,
            SwitchOnDisabled,
        ],
        [
            ReadyToSwitchOn,
            SwitchedOn,
            OperationEnabled,
            SwitchOnDisabled,
            SwitchOnDisabled,
            ReadyToSwitchOn,
        ],
        [
            ReadyToSwitchOn,
            SwitchedOn,
            OperationEnabled,
            SwitchOnDisabled,
            SwitchOnDisabled,
            SwitchedOn,
        ],
        [
            ReadyToSwitchOn,
            SwitchedOn,
            OperationEnabled,
            SwitchOnDisabled,
            QuickStopActive,
            OperationEnabled,
        ],
        [
            QuickStopActive,
            QuickStopActive,
            OperationEnabled,
            SwitchOnDisabled,
            QuickStopActive,
            QuickStopActive,
        ],
        [FaultReactionActive; 6],
        [Fault, Fault, Fault, Fault, Fault, SwitchOnDisabled],
    ];
    let commands = [0x06, 0x07, 0x0F, 0x00, 0x02, 0x80];
    for (state, row) in STATES.into_iter().zip(table) {
        for (controlword, expected) in commands.into_iter().zip(row) {
            let mut m = machine(state);
            let reset = m.control(controlword, OPTIONS, true);
            assert_eq!(reset, state == Fault && controlword == 0x80);
            if m.leaving.is_some() {
                assert_eq!(m.state, state, "waits for the ramp");
                m.cycle(true);
            }
            assert_eq!(m.state, expected, "{state:?} {controlword:#x}");
        }
    }
}

#[test]
fn a_fault_from_every_state_ends_in_fault() {
    let reactions = [
        Reaction::Disable,
        Reaction::FaultReaction,
        Reaction::AbortConnection,
    ];
    for state in STATES {
        for reaction in reactions {
            let mut m = machine(state);
            m.fault(reaction, OPTIONS);
            if state != State::Fault {
                assert_eq!(m.state(), State::FaultReactionActive);
                let stopping = matches!(state, State::OperationEnabled | State::QuickStopActive)
                    && reaction != Reaction::Disable;
                assert_eq!(m.powered(), stopping, "{state:?} {reaction:?}");
                assert_eq!(m.cycle(false), !stopping);
                m.cycle(true);
            }
            assert_eq!(m.state(), State::Fault);
            assert_eq!(m.power(), Power::Off);
        }
    }
}

#[test]
fn a_warning_changes_nothing() {
    for state in STATES {
        let mut m = machine(state);
        m.fault(Reaction::Warning, OPTIONS);
        assert_eq!(m.state(), state);
    }
}

#[test]
fn a_reset_needs_the_edge_and_the_cause_gone() {
    let mut m = machine(State::Fault);
    assert!(!m.control(0x80, OPTIONS, false));
    assert!(
        !m.control(0x80, OPTIONS, true),
        "no edge: it was set before"
    );
    assert!(!m.control(0x00, OPTIONS, true));
    assert!(m.control(0x80, OPTIONS, true));
    assert_eq!(m.state(), State::SwitchOnDisabled);
}

#[test]
fn a_worse_error_ends_the_ramp_of_a_milder_one() {
    let mut m = machine(State::OperationEnabled);
    m.fault(Reaction::AbortConnection, OPTIONS);
    assert_eq!(m.power(), Power::Stop(Ramp::QuickStop));
    m.fault(Reaction::Disable, OPTIONS);
    assert_eq!(m.power(), Power::Off);
}

#[test]
fn the_end_of_a_connection_stops_an_enabled_axis_without_fault() {
    let mut m = machine(State::OperationEnabled);
    m.connection_ends(OPTIONS);
    assert_eq!(m.power(), Power::Stop(Ramp::QuickStop));
    assert!(!m.control(0x0F, OPTIONS, true));
    assert_eq!(m.state(), State::QuickStopActive, "no way back in motion");
    m.cycle(true);
    assert_eq!(m.state(), State::SwitchOnDisabled);

    let at_once = Options {
        abort_connection: 2,
        ..OPTIONS
    };
    let mut m = machine(State::OperationEnabled);
    m.connection_ends(at_once);
    assert_eq!(m.state(), State::SwitchOnDisabled);
    assert_eq!(m.power(), Power::Off);
}

#[test]
fn statuswords_match_the_masks_of_the_standard() {
    let masks = [
        (State::NotReadyToSwitchOn, 0x4F, 0x00),
        (State::SwitchOnDisabled, 0x4F, 0x40),
        (State::ReadyToSwitchOn, 0x6F, 0x21),
        (State::SwitchedOn, 0x6F, 0x23),
        (State::OperationEnabled, 0x6F, 0x27),
        (State::QuickStopActive, 0x6F, 0x07),
        (State::FaultReactionActive, 0x4F, 0x0F),
        (State::Fault, 0x4F, 0x08),
    ];
    for state in STATES {
        let matching: Vec<_> = masks
            .iter()
            .filter(|(_, mask, value)| state.statusword() & mask == *value)
            .collect();
        assert_eq!(matching.len(), 1);
        assert_eq!(matching[0].0, state);
    }
}
