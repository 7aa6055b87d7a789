//! NMT states and what they allow (CiA 301, 7.3.2.2).

use crate::words::in_words;

/// The NMT state of a node as error control reports it (CiA 301, 7.2.8.3.2).
/// Unknown states survive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// On the wire: the boot-up message.
    Initialising,
    /// Only NMT and error control.
    Stopped,
    /// Everything.
    Operational,
    /// Everything but PDOs.
    PreOperational,
    /// Not a state that the standard knows; bit 7 is never set.
    Other(u8),
}

/// A communication service whose use depends on the NMT state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[expect(missing_docs, reason = "the names are those of the standard")]
pub enum Service {
    Pdo,
    Sdo,
    Sync,
    Time,
    Emergency,
    NodeControl,
    ErrorControl,
    Lss,
}

impl State {
    /// Without the toggle bit of node guarding.
    const MASK: u8 = 0x7F;

    /// The code on the wire.
    pub const fn code(self) -> u8 {
        match self {
            State::Initialising => 0x00,
            State::Stopped => 0x04,
            State::Operational => 0x05,
            State::PreOperational => 0x7F,
            State::Other(code) => code,
        }
    }

    /// The state with this code; bit 7 is ignored.
    pub const fn from_code(code: u8) -> State {
        match code & State::MASK {
            0x00 => State::Initialising,
            0x04 => State::Stopped,
            0x05 => State::Operational,
            0x7F => State::PreOperational,
            other => State::Other(other),
        }
    }

    /// Whether a node in this state takes part in `service`
    /// (CiA 301, 7.3.2.2.5, table 39; LSS: CiA 305).
    pub const fn allows(self, service: Service) -> bool {
        match self {
            State::Initialising | State::Other(_) => false,
            State::Operational => !matches!(service, Service::Lss),
            State::PreOperational => !matches!(service, Service::Pdo | Service::Lss),
            State::Stopped => matches!(
                service,
                Service::NodeControl | Service::ErrorControl | Service::Lss
            ),
        }
    }
}

in_words!(State {
    State::Initialising => ("initialising"),
    State::Stopped => ("stopped"),
    State::Operational => ("operational"),
    State::PreOperational => ("pre-operational"),
    State::Other(code) => ("unknown state {:02X}h", code),
});
