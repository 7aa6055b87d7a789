//! The state machine of the drive (CiA 402-2, 6; EPOS4 as far as it differs).
//!
//! Written from the standard for the drive's side alone: what the master
//! believes about these states is not used here, so that the two can disagree.

use super::errors::Reaction;

/// The states of the power drive system (CiA 402-2, 6.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// Self-test.
    NotReadyToSwitchOn,
    /// Waits for shutdown.
    SwitchOnDisabled,
    /// Waits for switch on.
    ReadyToSwitchOn,
    /// Waits for enable operation.
    SwitchedOn,
    /// Follows the set values of its mode.
    OperationEnabled,
    /// Slows down with the quick-stop ramp, or stands after it (605Ah = 6).
    QuickStopActive,
    /// Carries out the reaction to an error.
    FaultReactionActive,
    /// Waits for a fault reset.
    Fault,
}

impl State {
    /// Bits 0..3, 5 and 6 of the statusword.
    pub const fn statusword(self) -> u16 {
        match self {
            State::NotReadyToSwitchOn => 0x00,
            State::SwitchOnDisabled => 0x40,
            State::ReadyToSwitchOn => 0x21,
            State::SwitchedOn => 0x23,
            State::OperationEnabled => 0x27,
            State::QuickStopActive => 0x07,
            State::FaultReactionActive => 0x0F,
            State::Fault => 0x08,
        }
    }

    /// Bit 4: the power stage has its voltage.
    pub const fn voltage_enabled(self) -> bool {
        matches!(
            self,
            State::SwitchedOn
                | State::OperationEnabled
                | State::QuickStopActive
                | State::FaultReactionActive
        )
    }
}

/// What a controlword asks for (CiA 402-2, table of commands).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// xxxx xxxx 0xxx x110
    Shutdown,
    /// 0xxx 0111: in operation enabled it is "disable operation".
    SwitchOn,
    /// 0xxx 1111: in ready to switch on it is "switch on and enable".
    EnableOperation,
    /// 0xxx xx0x
    DisableVoltage,
    /// 0xxx x01x
    QuickStop,
    /// Bit 7 is set: the lower bits mean nothing, a rising edge resets.
    FaultReset,
}

/// Bit 7 of the controlword.
const FAULT_RESET: u16 = 0x80;

impl Command {
    /// The command of a controlword: every value has exactly one.
    pub const fn decode(controlword: u16) -> Command {
        if controlword & FAULT_RESET != 0 {
            Command::FaultReset
        } else if controlword & 0x02 == 0 {
            Command::DisableVoltage
        } else if controlword & 0x04 == 0 {
            Command::QuickStop
        } else if controlword & 0x01 == 0 {
            Command::Shutdown
        } else if controlword & 0x08 == 0 {
            Command::SwitchOn
        } else {
            Command::EnableOperation
        }
    }
}

/// With which ramp the axis comes to rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ramp {
    /// Profile deceleration, 6084h.
    SlowDown,
    /// Quick-stop deceleration, 6085h.
    QuickStop,
}

/// What the power stage does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Power {
    /// No torque.
    Off,
    /// The mode of operation moves the axis.
    Run,
    /// The axis is brought to rest and held.
    Stop(Ramp),
}

/// The option codes that take part, as the object dictionary holds them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// 605Bh: 0 disable, 1 slow down first.
    pub shutdown: i16,
    /// 605Ch: 0 disable, 1 slow down first.
    pub disable_operation: i16,
    /// 605Eh: 0 disable, 1 slow down, 2 quick-stop ramp.
    pub fault_reaction: i16,
    /// 6007h: 2 disable voltage, 3 quick-stop ramp.
    pub abort_connection: i16,
}

/// A way to rest that is under way, and the state that follows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Leaving {
    to: State,
    ramp: Ramp,
}

/// The state machine.
#[derive(Clone, Debug)]
pub struct Machine {
    state: State,
    controlword: u16,
    leaving: Option<Leaving>,
}

impl Default for Machine {
    fn default() -> Machine {
        Machine::new()
    }
}

impl Machine {
    /// After power-on (transition 0).
    pub fn new() -> Machine {
        Machine {
            state: State::NotReadyToSwitchOn,
            controlword: 0,
            leaving: None,
        }
    }

    /// The present state.
    pub fn state(&self) -> State {
        self.state
    }

    /// Whether the axis is powered and follows its mode or a ramp.
    pub fn powered(&self) -> bool {
        self.power() != Power::Off
    }

    /// What the power stage does.
    pub fn power(&self) -> Power {
        if let Some(leaving) = self.leaving {
            return Power::Stop(leaving.ramp);
        }
        match self.state {
            State::OperationEnabled => Power::Run,
            State::QuickStopActive => Power::Stop(Ramp::QuickStop),
            _ => Power::Off,
        }
    }

    /// A controlword arrives. `may_reset` says whether every cause of a fault
    /// is gone. Answers whether a fault was reset (transition 15).
    pub fn control(&mut self, controlword: u16, options: Options, may_reset: bool) -> bool {
        let edge = controlword & !self.controlword & FAULT_RESET != 0;
        self.controlword = controlword;
        if self.state == State::Fault {
            if edge && may_reset {
                self.state = State::SwitchOnDisabled;
                return true;
            }
            return false;
        }
        // A ramp under way is finished first; only torque can be taken away.
        let command = Command::decode(controlword);
        if self.leaving.is_some() && command != Command::DisableVoltage {
            return false;
        }
        self.transition(command, options);
        false
    }

    fn transition(&mut self, command: Command, options: Options) {
        use Command::*;
        use State::*;
        match (self.state, command) {
            (SwitchOnDisabled, Shutdown) => self.go(ReadyToSwitchOn), // 2
            (ReadyToSwitchOn, SwitchOn) => self.go(SwitchedOn),       // 3
            (ReadyToSwitchOn | SwitchedOn, EnableOperation) => self.go(OperationEnabled), // (3 +) 4
            (OperationEnabled, SwitchOn) => {
                // 5
                self.leave(SwitchedOn, options.disable_operation != 0);
            }
            (SwitchedOn, Shutdown) => self.go(ReadyToSwitchOn), // 6
            (ReadyToSwitchOn, DisableVoltage | QuickStop) => self.go(SwitchOnDisabled), // 7
            (OperationEnabled, Shutdown) => {
                // 8
                self.leave(ReadyToSwitchOn, options.shutdown != 0);
            }
            (OperationEnabled, DisableVoltage) => self.go(SwitchOnDisabled), // 9
            (SwitchedOn, DisableVoltage | QuickStop) => self.go(SwitchOnDisabled), // 10
            (OperationEnabled, QuickStop) => self.go(QuickStopActive),       // 11
            (QuickStopActive, DisableVoltage) => self.go(SwitchOnDisabled),  // 12
            (QuickStopActive, EnableOperation) => self.go(OperationEnabled), // 16
            _ => {}
        }
    }

    fn go(&mut self, to: State) {
        self.state = to;
        self.leaving = None;
    }

    fn leave(&mut self, to: State, slow_down: bool) {
        if slow_down {
            let ramp = Ramp::SlowDown;
            self.leaving = Some(Leaving { to, ramp });
        } else {
            self.go(to);
        }
    }

    /// An error occurs (transition 13). A warning changes nothing.
    pub fn fault(&mut self, reaction: Reaction, options: Options) {
        let ramp = match reaction {
            Reaction::Warning => return,
            Reaction::Disable => None,
            Reaction::FaultReaction => match options.fault_reaction {
                1 => Some(Ramp::SlowDown),
                2 => Some(Ramp::QuickStop),
                _ => None,
            },
            Reaction::AbortConnection => abort_ramp(options),
        };
        if self.state == State::Fault {
            return;
        }
        let powered = self.powered();
        if self.state == State::FaultReactionActive && ramp.is_some() {
            return;
        }
        self.state = State::FaultReactionActive;
        let to = State::Fault;
        self.leaving = ramp.filter(|_| powered).map(|ramp| Leaving { to, ramp });
    }

    /// The power stage loses its voltage or its enabling input: no error, but the
    /// axis has no torque any more (transitions 7, 9, 10 and 12).
    pub fn drop_out(&mut self) {
        use State::{OperationEnabled, QuickStopActive, ReadyToSwitchOn, SwitchedOn};
        if let ReadyToSwitchOn | SwitchedOn | OperationEnabled | QuickStopActive = self.state {
            self.go(State::SwitchOnDisabled);
        }
    }

    /// Communication ends in an orderly way: NMT takes the drive out of
    /// operational, or resets it. The axis acts as 6007h says, without fault.
    pub fn connection_ends(&mut self, options: Options) {
        if !matches!(self.state, State::OperationEnabled | State::QuickStopActive) {
            return;
        }
        match abort_ramp(options) {
            Some(ramp) => {
                self.state = State::QuickStopActive;
                let to = State::SwitchOnDisabled;
                self.leaving = Some(Leaving { to, ramp });
            }
            None => self.go(State::SwitchOnDisabled),
        }
    }

    /// Once per control cycle. `at_rest`: a ramp has reached zero and the axis
    /// stands (or the drive has waited long enough). Answers whether the state
    /// changed, so that the last controlword is to be looked at again.
    pub fn cycle(&mut self, at_rest: bool) -> bool {
        match (self.state, self.leaving) {
            (State::NotReadyToSwitchOn, _) => self.go(State::SwitchOnDisabled), // 1
            (_, Some(leaving)) if at_rest => self.go(leaving.to),
            (State::FaultReactionActive, None) => self.go(State::Fault), // 14
            _ => return false,
        }
        true
    }
}

fn abort_ramp(options: Options) -> Option<Ramp> {
    (options.abort_connection == 3).then_some(Ramp::QuickStop)
}

#[cfg(test)]
mod tests;
