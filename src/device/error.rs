//! What can be wrong with the master itself, as emergencies.

use crate::emcy::{Emcy, EmcyCode, ErrorRegister};
use crate::id::NodeId;

/// An error of the master (CiA 301, 7.2.7.1, table 26, and device specific
/// codes). The bytes of the manufacturer name the node first, where there is
/// one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum MasterError {
    /// 8110h: a receive FIFO or queue overran, frames were lost.
    Overrun,
    /// 8120h: the CAN controller is error passive.
    ErrorPassive,
    /// 8140h: recovered from bus-off.
    BusOffRecovered,
    /// 8130h: the heartbeat or the guarding answers of a node stayed away.
    NodeLost {
        /// Who.
        node: NodeId,
    },
    /// 8210h or 8220h: a TPDO has another length than mapped.
    PdoLength {
        /// Whose.
        node: NodeId,
        /// 1 ..= 4.
        tpdo: u8,
        /// It is shorter; else longer.
        short: bool,
    },
    /// 8250h: a TPDO of a node stayed away.
    PdoMissing {
        /// Whose.
        node: NodeId,
        /// 1 ..= 4; 0: any.
        tpdo: u8,
    },
    /// 6010h: the watchdog has reset the board.
    Watchdog,
    /// 5530h: the settings could not be read or stored.
    Storage,
    /// FF40h: a node could not be booted.
    BootFailed {
        /// Who.
        node: NodeId,
        /// The letter of CiA 302-2.
        letter: u8,
    },
    /// FF41h: an axis is faulted, the group stopped.
    AxisFault {
        /// Whose.
        node: NodeId,
        /// Its emergency error code, 0 if it sent none.
        code: EmcyCode,
    },
}

impl MasterError {
    /// The code of [`PdoMissing`](MasterError::PdoMissing).
    pub const PDO_MISSING: EmcyCode = EmcyCode(0x8250);
    /// The code of [`BootFailed`](MasterError::BootFailed).
    pub const BOOT_FAILED: EmcyCode = EmcyCode(0xFF40);
    /// The code of [`AxisFault`](MasterError::AxisFault).
    pub const AXIS_FAULT: EmcyCode = EmcyCode(0xFF41);

    /// The emergency that reports it, with the bits of the error register that
    /// it sets.
    pub const fn emcy(self) -> Emcy {
        const COMMUNICATION: ErrorRegister = ErrorRegister::COMMUNICATION;
        const GENERIC: ErrorRegister = ErrorRegister::GENERIC;
        const OF_MANUFACTURER: ErrorRegister = ErrorRegister::MANUFACTURER;
        const fn of(code: u16, register: ErrorRegister, [a, b, c]: [u8; 3]) -> Emcy {
            Emcy {
                manufacturer: [a, b, c, 0, 0],
                ..Emcy::new(EmcyCode(code), register)
            }
        }
        const NOBODY: [u8; 3] = [0; 3];
        match self {
            MasterError::Overrun => of(0x8110, COMMUNICATION, NOBODY),
            MasterError::ErrorPassive => of(0x8120, COMMUNICATION, NOBODY),
            MasterError::NodeLost { node } => of(0x8130, COMMUNICATION, [node.get(), 0, 0]),
            MasterError::BusOffRecovered => of(0x8140, COMMUNICATION, NOBODY),
            MasterError::PdoLength { node, tpdo, short } => {
                let code = if short { 0x8210 } else { 0x8220 };
                of(code, COMMUNICATION, [node.get(), tpdo, 0])
            }
            MasterError::PdoMissing { node, tpdo } => {
                of(Self::PDO_MISSING.0, COMMUNICATION, [node.get(), tpdo, 0])
            }
            MasterError::Watchdog => of(0x6010, GENERIC, NOBODY),
            MasterError::Storage => of(0x5530, GENERIC, NOBODY),
            MasterError::BootFailed { node, letter } => of(
                Self::BOOT_FAILED.0,
                OF_MANUFACTURER,
                [node.get(), letter, 0],
            ),
            MasterError::AxisFault { node, code } => {
                let [low, high] = code.0.to_le_bytes();
                of(Self::AXIS_FAULT.0, OF_MANUFACTURER, [node.get(), low, high])
            }
        }
    }
}
