//! How far the SYNCs of one cycle are apart on different buses.

use crate::time::Time;

/// From the starts of frame of the SYNCs on each bus, in order: the longest time
/// from the first to the last SYNC of a cycle, microseconds. SYNCs belong together
/// that are less than half a cycle apart; where one has no partner on a bus, that
/// is a missed cycle and no skew. 0 with one bus.
pub fn skew_us(buses: &[Vec<Time>], cycle: Time) -> f64 {
    let Some((first, others)) = buses.split_first() else {
        return 0.0;
    };
    let half = Time(cycle.0 / 2);
    let mut worst = Time::ZERO;
    let mut next = vec![0; others.len()];
    for &sync in first {
        let (mut earliest, mut latest) = (sync, sync);
        for (bus, next) in others.iter().zip(&mut next) {
            while bus.get(*next).is_some_and(|&other| other + half < sync) {
                *next += 1;
            }
            let partner = bus.get(*next).filter(|&&other| other < sync + half);
            if let Some(&partner) = partner {
                earliest = earliest.min(partner);
                latest = latest.max(partner);
            }
        }
        worst = worst.max(latest - earliest);
    }
    worst.as_us_f64()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn syncs(us: &[u64]) -> Vec<Time> {
        us.iter().map(|&us| Time::from_us(us)).collect()
    }

    #[test]
    fn the_worst_cycle_counts() {
        let buses = [
            syncs(&[1000, 2000, 3000]),
            syncs(&[1001, 1998, 3000]),
            syncs(&[1000, 2002, 3001]),
        ];
        assert_eq!(skew_us(&buses, Time::from_ms(1)), 4.0);
        assert_eq!(skew_us(&buses[..1], Time::from_ms(1)), 0.0);
        assert_eq!(skew_us(&[], Time::from_ms(1)), 0.0);
    }

    #[test]
    fn a_sync_without_a_partner_is_no_skew() {
        let buses = [syncs(&[1000, 2000, 3000]), syncs(&[400, 1001, 3002, 4000])];
        assert_eq!(skew_us(&buses, Time::from_ms(1)), 2.0);
    }
}
