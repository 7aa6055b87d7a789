//! COB-ID of the emergency message, object 1014h.

use crate::id::{CobId, FunctionCode, NodeId};
use crate::sdo::AbortCode;

/// COB-ID EMCY, object 1014h (CiA 301, 7.5.2.17).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct EmcyCobId(pub u32);

impl EmcyCobId {
    const INVALID: u32 = 1 << 31;
    const ID_MASK: u32 = 0x7FF;

    /// The predefined identifier, 080h + node-ID.
    pub const fn predefined(node: NodeId) -> EmcyCobId {
        EmcyCobId(CobId::of(FunctionCode::Emcy, node).get() as u32)
    }

    /// The identifier to send with; `None` if emergencies are switched off.
    pub const fn id(self) -> Option<CobId> {
        if self.0 & !EmcyCobId::ID_MASK != 0 {
            return None;
        }
        CobId::new(self.0 as u16)
    }

    /// Whether `self` may replace `old`: the identifier changes only while the
    /// object is switched off, is not extended, and is not restricted
    /// (CiA 301, 7.3.5, table 40).
    ///
    /// # Errors
    /// 06090030h.
    pub fn may_replace(self, old: EmcyCobId) -> Result<(), AbortCode> {
        let id = CobId::new((self.0 & EmcyCobId::ID_MASK) as u16).ok_or(AbortCode::VALUE_RANGE)?;
        let reserved = self.0 & !(EmcyCobId::INVALID | EmcyCobId::ID_MASK) != 0;
        let moved = self.id().is_some() && old.id().is_some() && self != old;
        let restricted = self.id().is_some() && id.is_restricted();
        if reserved || moved || restricted {
            Err(AbortCode::VALUE_RANGE)
        } else {
            Ok(())
        }
    }
}
