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
    #[inline(never)]
    pub const fn emcy(self) -> Emcy {
        const NOBODY: [u8; 3] = [0; 3];
        let (code, [a, b, c]) = match self {
            MasterError::Overrun => (0x8110, NOBODY),
            MasterError::ErrorPassive => (0x8120, NOBODY),
            MasterError::NodeLost { node } => (0x8130, [node.get(), 0, 0]),
            MasterError::BusOffRecovered => (0x8140, NOBODY),
            MasterError::PdoLength { node, tpdo, short } => {
                let code = if short { 0x8210 } else { 0x8220 };
                (code, [node.get(), tpdo, 0])
            }
            MasterError::PdoMissing { node, tpdo } => (Self::PDO_MISSING.0, [node.get(), tpdo, 0]),
            MasterError::Watchdog => (0x6010, NOBODY),
            MasterError::Storage => (0x5530, NOBODY),
            MasterError::BootFailed { node, letter } => {
                (Self::BOOT_FAILED.0, [node.get(), letter, 0])
            }
            MasterError::AxisFault { node, code } => {
                let [low, high] = code.0.to_le_bytes();
                (Self::AXIS_FAULT.0, [node.get(), low, high])
            }
        };
        // Codes of one group have their bit in common (CiA 301, 7.5.2.2).
        let register = match code >> u8::BITS {
            0x81..=0x82 => ErrorRegister::COMMUNICATION,
            0xFF => ErrorRegister::MANUFACTURER,
            _ => ErrorRegister::GENERIC,
        };
        Emcy {
            manufacturer: [a, b, c, 0, 0],
            ..Emcy::new(EmcyCode(code), register)
        }
    }
}
