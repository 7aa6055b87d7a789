//! The cyclic part of the master's object dictionary: what the interrupt tasks
//! share. Each access touches one entry and is done in a few cycles.

use crate::frame::MAX_DATA;

/// How many TPDOs of each axis the master takes in.
pub const TPDOS_PER_AXIS: usize = 2;
/// Bytes of the process image of an axis in one direction: its PDOs one behind the
/// other, and four zeros, which are what an object is that is not mapped.
pub const IMAGE_BYTES: usize = TPDOS_PER_AXIS * MAX_DATA + 4;
/// The bits of a set of TPDOs.
const SLOTS_MAX: usize = u32::BITS as usize;

/// Which TPDO of which axis: its place in the process image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TpdoSlot(u8);

impl TpdoSlot {
    /// The TPDO `number` (0 = TPDO1) of the axis `axis`. `None` if the master
    /// takes in no such TPDO.
    pub const fn new(axis: usize, number: usize) -> Option<TpdoSlot> {
        if number < TPDOS_PER_AXIS && axis < SLOTS_MAX / TPDOS_PER_AXIS {
            Some(TpdoSlot((axis * TPDOS_PER_AXIS + number) as u8))
        } else {
            None
        }
    }

    /// The axis.
    pub const fn axis(self) -> usize {
        self.0 as usize / TPDOS_PER_AXIS
    }

    /// 0 for TPDO1, 1 for TPDO2.
    pub const fn number(self) -> usize {
        self.0 as usize % TPDOS_PER_AXIS
    }

    const fn bit(self) -> u32 {
        1 << self.0
    }
}

/// A set of TPDOs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct TpdoSlots(u32);

impl TpdoSlots {
    /// No TPDO.
    pub const NONE: TpdoSlots = TpdoSlots(0);

    /// Every TPDO of the first `axes` axes.
    pub const fn all_of(axes: usize) -> TpdoSlots {
        let bits = axes * TPDOS_PER_AXIS;
        TpdoSlots(if bits >= SLOTS_MAX {
            u32::MAX
        } else {
            (1 << bits) - 1
        })
    }

    /// Those that have bytes.
    const fn with_bytes(lengths: &[[u8; TPDOS_PER_AXIS]]) -> TpdoSlots {
        let (mut bits, mut bit, mut left) = (0, 1, lengths);
        while let Some(([first, second], others)) = left.split_first() {
            if *first > 0 {
                bits |= bit;
            }
            if *second > 0 {
                bits |= bit << 1;
            }
            bit <<= TPDOS_PER_AXIS;
            left = others;
        }
        TpdoSlots(bits)
    }

    /// Whether it holds `slot`.
    pub const fn contains(self, slot: TpdoSlot) -> bool {
        self.0 & slot.bit() != 0
    }

    /// Whether it holds none.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Its members.
    pub fn iter(self) -> impl Iterator<Item = TpdoSlot> {
        (0..SLOTS_MAX as u8)
            .map(TpdoSlot)
            .filter(move |slot| self.contains(*slot))
    }
}

/// What a received TPDO means for the cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reception {
    /// Others are still awaited, or this one came again or unexpected.
    Stored,
    /// It was the last that this SYNC had to bring.
    Last,
    /// It is shorter than the mapping: not stored (CiA 301, 7.2.2.4).
    TooShort,
}

/// A TPDO of another length than mapped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WrongLength {
    /// Which.
    pub slot: TpdoSlot,
    /// It is shorter, and was left; else it is longer, and its first bytes count.
    pub short: bool,
}

/// One cycle, as the PDO producer takes it up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cycle {
    /// The number of its SYNC, counted from 1.
    pub sync: u32,
    /// Cycles since the one taken up before: more than one if some were not.
    pub passed: u32,
    /// The expected TPDOs that did not come in time.
    pub missing: TpdoSlots,
}

/// The cyclic part of the object dictionary of a master of `AXES` axes.
#[derive(Debug)]
pub struct MasterOd<const AXES: usize> {
    /// The number of the SYNC that the cycle began with.
    sync: u32,
    /// That of the cycle that was last taken up.
    taken: u32,
    expected: TpdoSlots,
    received: TpdoSlots,
    /// The cycle of the last SYNC has not been taken up yet.
    open: bool,
    overruns: u32,
    wrong_length: Option<WrongLength>,
    /// The mapped bytes of each TPDO.
    lengths: &'static [[u8; TPDOS_PER_AXIS]; AXES],
    /// What last came.
    tpdos: [[u8; IMAGE_BYTES]; AXES],
}

impl<const AXES: usize> MasterOd<AXES> {
    /// `lengths` are the mapped bytes of each TPDO of each axis, each of which
    /// every SYNC has to bring.
    pub const fn new(lengths: &'static [[u8; TPDOS_PER_AXIS]; AXES]) -> MasterOd<AXES> {
        MasterOd {
            sync: 0,
            taken: 0,
            expected: TpdoSlots::with_bytes(lengths),
            received: TpdoSlots::NONE,
            open: false,
            overruns: 0,
            wrong_length: None,
            lengths,
            tpdos: [[0; IMAGE_BYTES]; AXES],
        }
    }

    /// Cycles that were not taken up before the next SYNC.
    pub fn overruns(&self) -> u32 {
        self.overruns
    }

    /// The last TPDO of another length than mapped, once.
    pub fn take_wrong_length(&mut self) -> Option<WrongLength> {
        self.wrong_length.take()
    }

    /// So many SYNCs were sent since the start. If that is news, the next cycle
    /// has begun. To be called before a TPDO is stored and a cycle is taken up, so
    /// that the SYNC itself has to wait for nobody.
    #[inline]
    pub fn follow(&mut self, syncs: u32) {
        let passed = syncs.wrapping_sub(self.sync);
        if passed != 0 {
            self.overruns = self.overruns.wrapping_add(passed - u32::from(!self.open));
            self.sync = syncs;
            self.received = TpdoSlots::NONE;
            self.open = true;
        }
    }

    /// A TPDO came.
    #[inline]
    pub fn store(&mut self, slot: TpdoSlot, data: [u8; MAX_DATA], length: usize) -> Reception {
        let mapped = self
            .lengths
            .get(slot.axis())
            .and_then(|axis| axis.get(slot.number()));
        let first = slot.number() * MAX_DATA;
        let stored = self
            .tpdos
            .get_mut(slot.axis())
            .and_then(|axis| axis.get_mut(first..))
            .and_then(<[u8]>::first_chunk_mut);
        let (Some(mapped), Some(stored)) = (mapped, stored) else {
            return Reception::Stored;
        };
        let mapped = usize::from(*mapped);
        if length != mapped {
            let short = length < mapped;
            self.wrong_length = Some(WrongLength { slot, short });
            if short {
                return Reception::TooShort;
            }
        }
        *stored = data;
        if self.received.contains(slot) {
            return Reception::Stored;
        }
        self.received = TpdoSlots(self.received.0 | slot.bit());
        if self.expected.contains(slot) && self.missing().is_empty() && self.open {
            Reception::Last
        } else {
            Reception::Stored
        }
    }

    fn missing(&self) -> TpdoSlots {
        TpdoSlots(self.expected.0 & !self.received.0)
    }

    /// Takes up the cycle: once per SYNC, as soon as every expected TPDO is in,
    /// or at the deadline with what there is. While the master does not produce
    /// SYNC, the deadline is a cycle in which every TPDO is missing: time goes on
    /// for the axes.
    #[inline]
    pub fn take_cycle(&mut self, producing: bool, deadline: bool) -> Option<Cycle> {
        let (missing, due) = if producing {
            let missing = self.missing();
            (missing, self.open && (missing.is_empty() || deadline))
        } else {
            (self.expected, deadline)
        };
        if !due {
            return None;
        }
        self.open = false;
        let passed = self.sync.wrapping_sub(self.taken).max(1);
        self.taken = self.sync;
        Some(Cycle {
            sync: self.sync,
            passed,
            missing,
        })
    }

    /// The TPDOs of an axis as they last came; zeros before.
    #[inline]
    pub fn image(&self, axis: usize) -> &[u8; IMAGE_BYTES] {
        self.tpdos.get(axis).unwrap_or(&[0; IMAGE_BYTES])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    static LENGTHS: [[u8; 2]; 2] = [[6, 6]; 2];

    fn slot(axis: usize, number: usize) -> TpdoSlot {
        TpdoSlot::new(axis, number).unwrap()
    }

    fn running() -> MasterOd<2> {
        let mut od = MasterOd::new(&LENGTHS);
        od.follow(1);
        od
    }

    fn bytes(axis: usize, od: &MasterOd<2>) -> [u8; MAX_DATA] {
        od.image(axis)[..MAX_DATA].try_into().unwrap()
    }

    #[test]
    fn slots_are_numbered_without_gaps() {
        let mut all = 0;
        for axis in 0..20 {
            for number in 0..3 {
                let made = TpdoSlot::new(axis, number);
                assert_eq!(made.is_some(), axis < 16 && number < 2);
                let Some(made) = made else { continue };
                assert_eq!((made.axis(), made.number()), (axis, number));
                all |= made.bit();
            }
        }
        assert_eq!(TpdoSlots(all), TpdoSlots::all_of(16));
        assert_eq!(TpdoSlots::all_of(6).iter().count(), 12);
        assert_eq!(TpdoSlots::with_bytes(&[[6, 6]; 16]), TpdoSlots::all_of(16));
        let some = TpdoSlots::with_bytes(&[[8, 0], [0, 1]]);
        assert!(some.iter().eq([slot(0, 0), slot(1, 1)]));
    }

    #[test]
    fn without_sync_the_deadline_alone_makes_the_cycle() {
        let mut od = MasterOd::<2>::new(&LENGTHS);
        assert_eq!(od.take_cycle(false, false), None);
        for slot in TpdoSlots::all_of(2).iter() {
            od.store(slot, [1; 8], 6);
        }
        assert_eq!(od.take_cycle(false, false), None);
        for _ in 0..2 {
            let cycle = od.take_cycle(false, true).unwrap();
            assert_eq!(cycle.missing, TpdoSlots::all_of(2));
            assert_eq!((cycle.sync, cycle.passed), (0, 1));
        }
        assert_eq!(od.take_cycle(true, true), None);
        od.follow(1);
        assert_eq!(od.take_cycle(true, true).unwrap().sync, 1);
    }

    #[test]
    fn the_last_expected_tpdo_releases_the_cycle_once() {
        let mut od = running();
        assert_eq!(od.store(slot(0, 0), [1; 8], 6), Reception::Stored);
        assert_eq!(od.store(slot(0, 0), [2; 8], 6), Reception::Stored);
        assert_eq!(od.store(slot(1, 0), [3; 8], 6), Reception::Stored);
        assert_eq!(od.store(slot(0, 1), [4; 8], 6), Reception::Stored);
        assert_eq!(od.take_cycle(true, false), None);
        assert_eq!(od.store(slot(1, 1), [5; 8], 6), Reception::Last);
        assert_eq!(od.store(slot(1, 1), [5; 8], 6), Reception::Stored);
        let cycle = od.take_cycle(true, false).unwrap();
        assert!(cycle.missing.is_empty());
        assert_eq!(od.take_cycle(true, true), None);
        assert_eq!(bytes(0, &od), [2; 8]);
    }

    #[test]
    fn the_deadline_takes_what_there_is_and_names_the_rest() {
        let mut od = running();
        od.store(slot(1, 0), [3; 8], 6);
        let cycle = od.take_cycle(true, true).unwrap();
        let missing: std::vec::Vec<_> = cycle.missing.iter().collect();
        assert_eq!(missing, [slot(0, 0), slot(0, 1), slot(1, 1)]);
        // What comes after the deadline opens nothing.
        od.store(slot(0, 0), [3; 8], 6);
        od.store(slot(0, 1), [3; 8], 6);
        assert_eq!(od.store(slot(1, 1), [3; 8], 6), Reception::Stored);
        assert_eq!(od.take_cycle(true, true), None);
    }

    #[test]
    fn what_is_too_short_is_left_and_what_is_too_long_is_taken() {
        let mut od = running();
        assert_eq!(od.take_wrong_length(), None);
        let wrong = |short| {
            let slot = slot(0, 0);
            Some(WrongLength { slot, short })
        };
        for length in [0, 5] {
            let got = od.store(slot(0, 0), [9; 8], length);
            assert_eq!(got, Reception::TooShort);
            assert_eq!(od.take_wrong_length(), wrong(true));
        }
        assert_eq!(bytes(0, &od), [0; 8]);
        for length in [7, 8] {
            let got = od.store(slot(0, 0), [9; 8], length);
            assert_eq!(got, Reception::Stored);
            assert_eq!(od.take_wrong_length(), wrong(false));
            assert_eq!(od.take_wrong_length(), None);
        }
        assert_eq!(bytes(0, &od), [9; 8]);
    }

    #[test]
    fn a_cycle_nobody_takes_is_an_overrun() {
        let mut od = running();
        od.follow(1);
        assert_eq!(od.overruns(), 0);
        od.follow(2);
        assert_eq!(od.overruns(), 1);
        assert_eq!(od.take_cycle(true, true).unwrap().passed, 2);
        od.follow(3);
        assert_eq!(od.overruns(), 1);
        assert_eq!(od.take_cycle(true, true).unwrap().passed, 1);
        // Nobody looked for three SYNCs.
        od.follow(6);
        assert_eq!(od.overruns(), 3);
        assert_eq!(od.take_cycle(true, true).unwrap().passed, 3);
    }
}
