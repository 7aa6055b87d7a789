//! The controlword, object 6040h (CiA 402-2, 8.4.1).

/// A command of the state machine (CiA 402-2, table of command coding).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Command {
    /// Transitions 2, 6, 8: to ready to switch on.
    Shutdown,
    /// Transition 3: to switched on.
    SwitchOn,
    /// Transitions 4, 16: to operation enabled.
    EnableOperation,
    /// Transition 5: from operation enabled to switched on. On the wire it is
    /// the same as [`Command::SwitchOn`].
    DisableOperation,
    /// Transitions 7, 9, 10, 12: power stage off at once.
    DisableVoltage,
    /// Transitions 7, 10, 11: brake on the quick stop ramp.
    QuickStop,
    /// Transition 15, on the rising edge of bit 7.
    FaultReset,
}

impl Command {
    /// The bits of the controlword that the command decides, and their values.
    const fn coding(self) -> (u16, u16) {
        match self {
            Command::Shutdown => (0x87, 0x06),
            Command::SwitchOn | Command::DisableOperation => (0x8F, 0x07),
            Command::EnableOperation => (0x8F, 0x0F),
            Command::DisableVoltage => (0x82, 0x00),
            Command::QuickStop => (0x86, 0x02),
            Command::FaultReset => (0x80, 0x80),
        }
    }
}

/// The controlword, object 6040h.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct ControlWord(pub u16);

/// Bits 0 to 3 and 7 command the state machine, the others belong to the mode.
const STATE_BITS: u16 = 0x008F;
/// Bit 8: halt (modes PP, PV, HM).
const HALT: u16 = 1 << 8;

impl ControlWord {
    /// The controlword that gives `command` and nothing else.
    pub const fn new(command: Command) -> ControlWord {
        ControlWord(0).with(command)
    }

    /// This controlword with its state machine bits replaced by `command`; the
    /// bits of the mode (4 to 6, 8 and above) stay.
    pub const fn with(self, command: Command) -> ControlWord {
        ControlWord(self.0 & !STATE_BITS | command.coding().1)
    }

    /// Whether this controlword gives `command`. Bits that the profile leaves
    /// open for the command do not matter. [`Command::FaultReset`] needs an edge
    /// on top.
    pub const fn gives(self, command: Command) -> bool {
        let (mask, value) = command.coding();
        self.0 & mask == value
    }

    /// This controlword with bit 8 (halt) set or cleared.
    pub const fn with_halt(self, halt: bool) -> ControlWord {
        ControlWord(if halt { self.0 | HALT } else { self.0 & !HALT })
    }

    /// Bit 8: halt.
    pub const fn halt(self) -> bool {
        self.0 & HALT != 0
    }
}
