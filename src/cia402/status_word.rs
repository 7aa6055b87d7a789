//! The statusword, object 6041h (CiA 402-2, 8.4.2).

use crate::words::in_words;

/// States whose code has bit 5 undefined are told apart by these bits.
const MASK_WITHOUT_QUICK_STOP: u16 = 0x004F;
/// The other states also need bit 5 (quick stop, active low).
const MASK_STATE: u16 = 0x006F;

/// State of the power drive system's state machine (CiA 402-2, 8.3, table of
/// state coding).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum State {
    /// The drive initialises itself.
    NotReadyToSwitchOn,
    /// Parameters may be set; high voltage must not be switched on.
    SwitchOnDisabled,
    /// High voltage may be switched on.
    ReadyToSwitchOn,
    /// High voltage is on, the power stage is off.
    SwitchedOn,
    /// The power stage is on; the drive follows its target.
    OperationEnabled,
    /// The drive brakes on its quick stop ramp, or holds after it.
    QuickStopActive,
    /// The drive reacts to a fault, for example on its quick stop ramp.
    FaultReactionActive,
    /// The power stage is off because of a fault.
    Fault,
    /// A combination of the state bits that the profile does not define: bits
    /// 0 to 3, 5 and 6 of the statusword as they came.
    Other(u8),
}

impl State {
    /// Whether the drive's own logic has taken the axis away from the master's
    /// target: everything but [`State::OperationEnabled`].
    pub const fn is_enabled(self) -> bool {
        matches!(self, State::OperationEnabled)
    }

    /// Whether the drive reports a fault, reacting to it or after it.
    pub const fn is_fault(self) -> bool {
        matches!(self, State::Fault | State::FaultReactionActive)
    }

    /// The state bits of the statusword (0 to 3, 5 and 6) that stand for this
    /// state. Bits that the profile leaves open for the state are 0.
    pub const fn bits(self) -> u16 {
        match self {
            State::NotReadyToSwitchOn => 0x00,
            State::SwitchOnDisabled => 0x40,
            State::ReadyToSwitchOn => 0x21,
            State::SwitchedOn => 0x23,
            State::OperationEnabled => 0x27,
            State::QuickStopActive => 0x07,
            State::FaultReactionActive => 0x0F,
            State::Fault => 0x08,
            State::Other(bits) => bits as u16,
        }
    }
}

in_words!(State {
    State::NotReadyToSwitchOn => ("not ready to switch on"),
    State::SwitchOnDisabled => ("switch on disabled"),
    State::ReadyToSwitchOn => ("ready to switch on"),
    State::SwitchedOn => ("switched on"),
    State::OperationEnabled => ("operation enabled"),
    State::QuickStopActive => ("quick stop active"),
    State::FaultReactionActive => ("fault reaction active"),
    State::Fault => ("fault"),
    State::Other(bits) => ("undefined state bits {:#04x}", bits),
});

/// The statusword, object 6041h. Any value is kept as it came.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct StatusWord(pub u16);

impl StatusWord {
    /// The state of the drive's state machine.
    ///
    /// Bit 5 is not looked at in the states that leave it open: drives report
    /// it both ways in [`State::Fault`].
    pub const fn state(self) -> State {
        match self.0 & MASK_WITHOUT_QUICK_STOP {
            0x00 => return State::NotReadyToSwitchOn,
            0x40 => return State::SwitchOnDisabled,
            0x0F => return State::FaultReactionActive,
            0x08 => return State::Fault,
            _ => {}
        }
        match self.0 & MASK_STATE {
            0x21 => State::ReadyToSwitchOn,
            0x23 => State::SwitchedOn,
            0x27 => State::OperationEnabled,
            0x07 => State::QuickStopActive,
            other => State::Other(other as u8),
        }
    }

    /// Whether `other` stands for the same state for certain: all bits that may tell
    /// it are alike.
    pub(crate) const fn is_alike(self, other: StatusWord) -> bool {
        (self.0 ^ other.0) & MASK_STATE == 0
    }

    /// Whether the state is [`State::OperationEnabled`].
    pub const fn is_enabled(self) -> bool {
        self.0 & MASK_STATE == State::OperationEnabled.bits()
    }

    const fn bit(self, n: u16) -> bool {
        self.0 & (1 << n) != 0
    }

    /// Bit 4: high voltage is applied to the drive.
    pub const fn voltage_enabled(self) -> bool {
        self.bit(4)
    }

    /// Bit 7: a warning is present; the state has not changed for it.
    pub const fn warning(self) -> bool {
        self.bit(7)
    }

    /// Bit 9: the controlword is processed. EPOS4 reports it in NMT operational
    /// only.
    pub const fn remote(self) -> bool {
        self.bit(9)
    }

    /// Bit 10: the target (or, halted, standstill) is reached; modes PP, PV, HM.
    pub const fn target_reached(self) -> bool {
        self.bit(10)
    }

    /// Bit 11: an internal limit is active.
    pub const fn internal_limit(self) -> bool {
        self.bit(11)
    }

    /// Bit 12, meaning by mode: PP set-point acknowledged, PV speed is zero, HM
    /// homing attained, cyclic modes: the drive follows the command.
    pub const fn mode_bit_12(self) -> bool {
        self.bit(12)
    }

    /// Bit 13, meaning by mode: PP and CSP following error, HM homing error.
    pub const fn mode_bit_13(self) -> bool {
        self.bit(13)
    }
}
