//! Liveness by TPDO: where one comes every cycle, its absence is the alarm.

use super::od::{TPDOS_PER_AXIS, TpdoSlot, TpdoSlots};

/// A TPDO that stayed away too long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MissingTpdo {
    /// Whose.
    pub axis: usize,
    /// 1 for TPDO1, 2 for TPDO2.
    pub tpdo: u8,
}

/// Counts for each TPDO the cycles in a row in which it was missing.
#[derive(Debug)]
pub struct Liveness<const AXES: usize> {
    limit: u8,
    missed: [[u8; TPDOS_PER_AXIS]; AXES],
}

impl<const AXES: usize> Liveness<AXES> {
    /// `limit` cycles in a row are too many.
    pub const fn new(limit: u8) -> Liveness<AXES> {
        Liveness {
            limit,
            missed: [[0; TPDOS_PER_AXIS]; AXES],
        }
    }

    /// Takes in what a cycle missed. Returns the first TPDO that reached the
    /// limit in this very cycle: each absence is reported once.
    pub fn cycle(&mut self, missing: TpdoSlots) -> Option<MissingTpdo> {
        let mut found = None;
        for (axis, counters) in self.missed.iter_mut().enumerate() {
            for (number, counter) in counters.iter_mut().enumerate() {
                let here = TpdoSlot::new(axis, number).is_some_and(|s| !missing.contains(s));
                if here {
                    *counter = 0;
                    continue;
                }
                if *counter < self.limit {
                    *counter += 1;
                    if *counter == self.limit && found.is_none() {
                        found = Some(MissingTpdo {
                            axis,
                            tpdo: number as u8 + 1,
                        });
                    }
                }
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::master::MasterOd;

    /// The set of all TPDOs of two axes without those given.
    fn missing_all_but(present: &[(usize, usize)]) -> TpdoSlots {
        let mut od = MasterOd::<2>::new(&[[6; 2]; 2]);
        od.set_sync_producer(true);
        od.expect(TpdoSlots::all_of(2));
        od.open_cycle();
        for (axis, number) in present {
            od.store(TpdoSlot::new(*axis, *number).unwrap(), [0; 8], 6);
        }
        od.take_cycle(true).unwrap().missing
    }

    #[test]
    fn three_cycles_in_a_row_are_reported_once() {
        let without = missing_all_but(&[(0, 0), (0, 1), (1, 0)]);
        let mut liveness = Liveness::<2>::new(3);
        assert_eq!(liveness.cycle(without), None);
        assert_eq!(liveness.cycle(without), None);
        let expected = MissingTpdo { axis: 1, tpdo: 2 };
        assert_eq!(liveness.cycle(without), Some(expected));
        assert_eq!(liveness.cycle(without), None);
    }

    #[test]
    fn one_that_comes_back_starts_anew() {
        let without = missing_all_but(&[(0, 0), (0, 1), (1, 0)]);
        let mut liveness = Liveness::<2>::new(3);
        for _ in 0..4 {
            assert_eq!(liveness.cycle(without), None);
            assert_eq!(liveness.cycle(without), None);
            assert_eq!(liveness.cycle(TpdoSlots::NONE), None);
        }
    }

    #[test]
    fn a_silent_axis_is_named_by_its_first_tpdo() {
        let without = missing_all_but(&[(1, 0), (1, 1)]);
        let mut liveness = Liveness::<2>::new(1);
        let expected = MissingTpdo { axis: 0, tpdo: 1 };
        assert_eq!(liveness.cycle(without), Some(expected));
    }
}
