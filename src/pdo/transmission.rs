//! Sub-index 2 of the communication parameters: the transmission type.

use super::Direction;

/// When a PDO is sent or takes effect (CiA 301, 7.5.2.35, table 68; 7.5.2.37,
/// table 72).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Transmission {
    /// 0: at the SYNC after an event. For RPDOs all of 0..=240 are the same.
    SynchronousAcyclic,
    /// 1..=240: at every n-th SYNC.
    Synchronous(u8),
    /// 252: sampled at SYNC, sent on a remote frame.
    RtrSynchronous,
    /// 253: sampled and sent on a remote frame.
    Rtr,
    /// 254: on an event that the manufacturer defines.
    EventManufacturer,
    /// 255: on an event that the profile defines.
    EventProfile,
    /// 241..=251: reserved.
    Reserved(u8),
}

impl Transmission {
    /// The largest n of "every n-th SYNC".
    const CYCLIC_MAX: u8 = 240;

    /// The type with this code.
    pub const fn from_code(code: u8) -> Transmission {
        match code {
            0 => Transmission::SynchronousAcyclic,
            1..=Transmission::CYCLIC_MAX => Transmission::Synchronous(code),
            252 => Transmission::RtrSynchronous,
            253 => Transmission::Rtr,
            254 => Transmission::EventManufacturer,
            255 => Transmission::EventProfile,
            _ => Transmission::Reserved(code),
        }
    }

    /// The code.
    pub const fn code(self) -> u8 {
        match self {
            Transmission::SynchronousAcyclic => 0,
            Transmission::Synchronous(n) => n,
            Transmission::RtrSynchronous => 252,
            Transmission::Rtr => 253,
            Transmission::EventManufacturer => 254,
            Transmission::EventProfile => 255,
            Transmission::Reserved(code) => code,
        }
    }

    /// Whether the standard has this type for this direction.
    pub const fn exists(self, direction: Direction) -> bool {
        match self {
            Transmission::Reserved(_) => false,
            Transmission::RtrSynchronous | Transmission::Rtr => {
                matches!(direction, Direction::Transmit)
            }
            _ => true,
        }
    }

    /// Whether an RPDO of this type waits for the next SYNC.
    pub const fn is_synchronous(self) -> bool {
        matches!(
            self,
            Transmission::SynchronousAcyclic | Transmission::Synchronous(_)
        )
    }

    /// Whether a TPDO of this type is sent on events.
    pub const fn is_event_driven(self) -> bool {
        matches!(
            self,
            Transmission::EventManufacturer | Transmission::EventProfile
        )
    }
}
