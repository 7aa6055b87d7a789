//! Cycles that did not finish in time: one is counted, several in a row stop the
//! group.

/// Counts late cycles in a row.
///
/// `MAX` in a row are tolerated.
#[derive(Debug, Default)]
pub struct Overload<const MAX: u8> {
    late: u8,
}

impl<const MAX: u8> Overload<MAX> {
    /// None was late yet.
    pub const fn new() -> Overload<MAX> {
        Overload { late: 0 }
    }

    /// A cycle is taken up, the `passed`-th after the one before: more than one if
    /// some were not taken up at all. `unsent`: RPDOs of the one before did not get
    /// out. When there are more late ones in a row than tolerated, how many; once,
    /// until one was in time.
    pub fn cycle(&mut self, passed: u32, unsent: bool) -> Option<u8> {
        let more = passed.saturating_sub(1).saturating_add(u32::from(unsent));
        if more == 0 {
            self.late = 0;
            return None;
        }
        let before = self.late;
        self.late = before.saturating_add(u8::try_from(more).unwrap_or(u8::MAX));
        (before <= MAX && self.late > MAX).then_some(self.late)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cycles_in_time_are_no_news() {
        let mut overload = Overload::<2>::new();
        assert!((0..100).all(|_| overload.cycle(1, false).is_none()));
    }

    #[test]
    fn one_now_and_then_is_tolerated() {
        let mut overload = Overload::<2>::new();
        for n in 0..100 {
            assert_eq!(overload.cycle(1, n % 3 != 0), None);
            assert_eq!(overload.cycle(1 + n % 2, false), None);
            assert_eq!(overload.cycle(1, false), None);
        }
    }

    #[test]
    fn several_in_a_row_are_told_once() {
        let mut overload = Overload::<2>::new();
        assert_eq!(overload.cycle(1, true), None);
        assert_eq!(overload.cycle(2, false), None);
        assert_eq!(overload.cycle(1, true), Some(3));
        assert_eq!(overload.cycle(2, true), None);
        assert_eq!(overload.cycle(1, false), None);
        assert_eq!(overload.cycle(5, false), Some(4));
    }

    #[test]
    fn a_long_pause_does_not_overflow() {
        let mut overload = Overload::<2>::new();
        assert_eq!(overload.cycle(u32::MAX, true), Some(u8::MAX));
        assert_eq!(overload.cycle(u32::MAX, true), None);
    }
}
