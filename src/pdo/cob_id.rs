//! Sub-index 1 of the communication parameters: the COB-ID and its flags.

use crate::id::CobId;
use crate::sdo::AbortCode;

/// The COB-ID of a PDO as the object dictionary has it
/// (CiA 301, 7.5.2.35, 7.5.2.37).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PdoCobId(pub u32);

impl PdoCobId {
    const INVALID: u32 = 1 << 31;
    const NO_RTR: u32 = 1 << 30;
    const EXTENDED: u32 = 1 << 29;
    const ID_MASK: u32 = 0x7FF;

    /// A PDO that exists.
    pub const fn valid(id: CobId) -> PdoCobId {
        PdoCobId(id.get() as u32)
    }

    /// The same PDO switched off: bit 31 set.
    pub const fn invalid(self) -> PdoCobId {
        PdoCobId(self.0 | PdoCobId::INVALID)
    }

    /// The same PDO not to be requested by remote frames: bit 30 set. For
    /// TPDOs.
    pub const fn without_rtr(self) -> PdoCobId {
        PdoCobId(self.0 | PdoCobId::NO_RTR)
    }

    /// Whether the PDO exists: bit 31 clear.
    pub const fn is_valid(self) -> bool {
        self.0 & PdoCobId::INVALID == 0
    }

    /// Whether remote frames may request it: bit 30 clear.
    pub const fn allows_rtr(self) -> bool {
        self.0 & PdoCobId::NO_RTR == 0
    }

    /// The identifier; `None` if it is an extended one.
    pub const fn id(self) -> Option<CobId> {
        if self.0 & PdoCobId::EXTENDED != 0 {
            return None;
        }
        CobId::new((self.0 & PdoCobId::ID_MASK) as u16)
    }

    /// Whether `self` may replace `old`: the identifier of a PDO that exists
    /// may be replaced only by switching it off, extended identifiers are not
    /// supported, and what exists must not use a restricted identifier
    /// (CiA 301, 7.3.5, table 40).
    ///
    /// # Errors
    /// 06090030h.
    pub fn may_replace(self, old: PdoCobId) -> Result<(), AbortCode> {
        let id = self.id().ok_or(AbortCode::VALUE_RANGE)?;
        let reserved = self.0 & !(PdoCobId::INVALID | PdoCobId::NO_RTR | PdoCobId::ID_MASK);
        let moved = self.is_valid() && old.is_valid() && Some(id) != old.id();
        if reserved != 0 || moved || (self.is_valid() && id.is_restricted()) {
            return Err(AbortCode::VALUE_RANGE);
        }
        Ok(())
    }
}
