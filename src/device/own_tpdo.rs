//! TPDO1 to TPDO4 of the board itself, 1800h to 1803h, by which any tool can follow the
//! group: TPDO1 carries its state (2001h) and the step of the program (2010h), TPDO2 to
//! TPDO4 the actual positions of the first six axes (2009h). What each carries is
//! constant.
//!
//! They are off (bit 31 of the COB-ID) until a client switches them on, since they take
//! room in the cycle. The transmission type is the number of SYNCs from one to the next;
//! it can not be less than the layout of the cycle allows.

use crate::id::{Address, CobId, FunctionCode, NodeId};
use crate::objects;
use crate::pdo::{MappingEntry, PdoCobId};
use crate::sdo::AbortCode;

/// How many there are; those that mirror the RPDOs of the nodes follow.
pub(super) const OWN_TPDOS: u16 = 4;
/// The longest synchronous transmission type (CiA 301, 7.5.2.37).
const SLOWEST: u8 = 240;
/// Axes in one of them.
const AXES: u16 = 2;

/// What they carry.
const STATE: MappingEntry = MappingEntry::new(0x2001, 0, 8);
const STEP: MappingEntry = MappingEntry::new(0x2010, 0, 16);
const POSITION: u16 = 0x2009;
const POSITION_BITS: u8 = 32;

/// Their parameters and what is due.
#[derive(Debug)]
pub(super) struct OwnTpdos {
    /// Transmission types, and SYNCs until each is sent.
    every: [u8; OWN_TPDOS as usize],
    left: [u8; OWN_TPDOS as usize],
    /// Bit n: that one is on, or is to be sent.
    on: u8,
    due: u8,
    /// The least transmission type.
    least: u8,
}

impl OwnTpdos {
    pub(super) const fn new(least: u8) -> OwnTpdos {
        OwnTpdos {
            every: [least; OWN_TPDOS as usize],
            left: [least; OWN_TPDOS as usize],
            on: 0,
            due: 0,
            least,
        }
    }

    /// The entry `sub` of the communication parameter `n`, counted from 0.
    pub(super) fn get(&self, n: u16, sub: u8, node: NodeId) -> u32 {
        match sub {
            objects::PDO_COB_ID => self.cob_id(n, node).0,
            _ => self.every.get(usize::from(n)).copied().unwrap_or(0).into(),
        }
    }

    /// Writes it.
    pub(super) fn set(
        &mut self,
        n: u16,
        sub: u8,
        node: NodeId,
        value: u32,
    ) -> Result<(), AbortCode> {
        let place = usize::from(n);
        let (Some(every), Some(left)) = (self.every.get_mut(place), self.left.get_mut(place))
        else {
            return Err(AbortCode::NO_SUCH_OBJECT);
        };
        if sub == objects::PDO_COB_ID {
            let id = PdoCobId::valid(id(n, node)).without_rtr();
            let on = value == id.0;
            if !on && value != id.invalid().0 {
                return Err(AbortCode::VALUE_RANGE);
            }
            self.on = self.on & !(1 << n) | u8::from(on) << n;
            *left = *every;
            return Ok(());
        }
        if !(u32::from(self.least)..=u32::from(SLOWEST)).contains(&value) {
            return Err(AbortCode::VALUE_RANGE);
        }
        (*every, *left) = (value as u8, value as u8);
        Ok(())
    }

    fn cob_id(&self, n: u16, node: NodeId) -> PdoCobId {
        let id = PdoCobId::valid(id(n, node)).without_rtr();
        match self.on >> n & 1 {
            0 => id.invalid(),
            _ => id,
        }
    }

    /// A SYNC has been sent.
    pub(super) fn on_sync(&mut self) {
        for (n, (left, every)) in self.left.iter_mut().zip(&self.every).enumerate() {
            *left = left.saturating_sub(1);
            if *left == 0 {
                *left = *every;
                self.due |= self.on & 1 << n;
            }
        }
    }

    /// The next that is to be sent, once.
    pub(super) fn take_due(&mut self) -> Option<u16> {
        let n = self.due.trailing_zeros();
        self.due &= self.due.wrapping_sub(1);
        (n < u8::BITS).then_some(n as u16)
    }

    /// Whether any is on.
    pub(super) const fn any(&self) -> bool {
        self.on != 0
    }
}

/// The identifier of the predefined connection set.
pub(super) fn id(n: u16, node: NodeId) -> CobId {
    let function = match n {
        0 => FunctionCode::Tpdo1,
        1 => FunctionCode::Tpdo2,
        2 => FunctionCode::Tpdo3,
        _ => FunctionCode::Tpdo4,
    };
    CobId::of(function, node)
}

/// The entry `sub` of the mapping of TPDO `n`, counted from 0, with so many axes.
pub(super) fn mapped(n: u16, sub: u8, axes: usize) -> Option<MappingEntry> {
    match (n, sub) {
        (0, 1) => Some(STATE),
        (0, 2) => Some(STEP),
        (1..OWN_TPDOS, 1..=2) => {
            let axis = (n - 1) * AXES + u16::from(sub);
            let at = Address::new(POSITION, axis as u8);
            let entry = MappingEntry::new(at.index.0, at.sub.0, POSITION_BITS);
            (usize::from(axis) <= axes).then_some(entry)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NODE: NodeId = NodeId::constant::<127>();

    #[test]
    fn off_until_somebody_wants_them() {
        let mut tpdos = OwnTpdos::new(8);
        for (n, id) in [(0, 0x1FF), (1, 0x2FF), (2, 0x3FF), (3, 0x4FF)] {
            assert_eq!(tpdos.get(n, 1, NODE), 0xC000_0000 | id);
            assert_eq!(tpdos.get(n, 2, NODE), 8);
        }
        for _ in 0..100 {
            tpdos.on_sync();
        }
        assert!(!tpdos.any());
        assert_eq!(tpdos.take_due(), None);
    }

    #[test]
    fn every_so_many_syncs() {
        let mut tpdos = OwnTpdos::new(2);
        tpdos.set(0, 1, NODE, 0x4000_01FF).unwrap();
        tpdos.set(2, 1, NODE, 0x4000_03FF).unwrap();
        tpdos.set(2, 2, NODE, 3).unwrap();
        let sent: std::vec::Vec<_> = (1..=6)
            .flat_map(|sync| {
                tpdos.on_sync();
                let due: std::vec::Vec<_> = core::iter::from_fn(|| tpdos.take_due()).collect();
                due.into_iter().map(move |n| (sync, n))
            })
            .collect();
        assert_eq!(sent, [(2, 0), (3, 2), (4, 0), (6, 0), (6, 2)]);
        tpdos.set(0, 1, NODE, 0xC000_01FF).unwrap();
        tpdos.set(2, 1, NODE, 0xC000_03FF).unwrap();
        assert!(!tpdos.any());
    }

    #[test]
    fn what_the_cycle_has_no_room_for_is_refused() {
        let mut tpdos = OwnTpdos::new(8);
        for (sub, value) in [
            (1, 0x4000_01FE),
            (1, 0x0000_01FF),
            (1, 0x4000_02FF),
            (2, 0),
            (2, 7),
            (2, 241),
            (2, 254),
        ] {
            let refused = Err(AbortCode::VALUE_RANGE);
            assert_eq!(tpdos.set(0, sub, NODE, value), refused, "{value:X}");
        }
        assert_eq!(tpdos.set(0, 2, NODE, 240), Ok(()));
    }

    #[test]
    fn as_many_positions_as_there_are_axes() {
        assert_eq!(mapped(0, 1, 1), Some(MappingEntry(0x2001_0008)));
        assert_eq!(mapped(0, 2, 1), Some(MappingEntry(0x2010_0010)));
        assert_eq!(mapped(1, 1, 5), Some(MappingEntry(0x2009_0120)));
        assert_eq!(mapped(3, 1, 5), Some(MappingEntry(0x2009_0520)));
        assert_eq!(mapped(3, 2, 5), None);
        assert_eq!(mapped(3, 2, 6), Some(MappingEntry(0x2009_0620)));
        assert_eq!(mapped(4, 1, 6), None);
    }
}
