//! Whether a run is good, and if not, why in one sentence.

use std::fmt;

use canmaster::NodeId;

use super::arrivals::{Arrival, Assignment, Part, Release, worst_pair};
use super::axis::{AxisMonitor, Movement, STANDSTILL_RPM};
use super::bus::BusFigures;
use crate::time::Time;

/// How far from its target an axis may come to rest, increments, at a cycle of
/// 10 ms or less.
pub const ARRIVAL_TOLERANCE: i64 = 5;

/// The same at any cycle: what the position loop cannot see in time grows with the
/// cycle.
pub fn arrival_tolerance(cycle: Time) -> i64 {
    const LONGEST_US: u64 = 10_000;
    let us = cycle.as_us().max(LONGEST_US);
    ARRIVAL_TOLERANCE * us as i64 / LONGEST_US as i64
}

/// How far apart axes that belong together may stop: one cycle; in a shorter one what
/// the drives' own loops spread. At the end of a ramp of 1000 rpm/s a loop of 10 ms is at
/// 10 rpm and falls below 5 rpm 7 ms later; one of 3 ms has been below for 2 ms by then.
/// Noise and the position loop add the rest.
pub fn stop_tolerance(cycle: Time) -> Time {
    const SPREAD: Time = Time::from_ms(10);
    cycle.max(SPREAD)
}

/// How long interrupts may be off at a time, cycles: SYNC must not wait.
pub const IRQ_OFF_LIMIT: u64 = 120;

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Every move of every drive arrived.
    Ok,
    /// Something went wrong.
    Failed,
    /// Nothing went wrong, but no whole round trip was made.
    Incomplete,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Outcome::Ok => "ok",
            Outcome::Failed => "failed",
            Outcome::Incomplete => "incomplete",
        })
    }
}

/// How a run ended and why.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verdict {
    /// How.
    pub outcome: Outcome,
    /// Why, for a person; empty if all is well.
    pub reason: String,
}

/// What a verdict is made from.
pub struct Evidence<'e> {
    /// The drives, in the order of the axes.
    pub nodes: &'e [NodeId],
    /// What the axes did.
    pub axes: &'e [AxisMonitor],
    /// What they should have done.
    pub assignment: &'e Assignment,
    /// What they were released for.
    pub releases: &'e [Release],
    /// Where they arrived.
    pub arrivals: &'e [Arrival],
    /// What was on the bus.
    pub bus: &'e BusFigures,
    /// The longest section with interrupts off, cycles.
    pub irq_off_cycles: u64,
    /// The firmware's first complaint.
    pub error_line: Option<&'e str>,
    /// The emulated board's first complaint about the firmware.
    pub board_complaint: Option<&'e str>,
    /// Why no (further) round trip was made.
    pub unfinished: &'e str,
}

/// Judges a run.
pub fn verdict(evidence: &Evidence<'_>) -> Verdict {
    if let Some(reason) = failure(evidence) {
        return Verdict {
            outcome: Outcome::Failed,
            reason,
        };
    }
    let whole = evidence
        .releases
        .iter()
        .any(|release| release.done.is_some() && !release.revoked);
    let started = evidence
        .releases
        .iter()
        .any(|release| release.done.is_none());
    if !whole || started {
        return Verdict {
            outcome: Outcome::Incomplete,
            reason: evidence.unfinished.to_string(),
        };
    }
    Verdict {
        outcome: Outcome::Ok,
        reason: String::new(),
    }
}

fn failure(evidence: &Evidence<'_>) -> Option<String> {
    // What the firmware says itself names cause and remedy; everything else
    // may be its consequence. The one thing worse is motion out of nowhere.
    unreleased(evidence)
        .or_else(|| evidence.error_line.map(|line| line.replace('\n', " ")))
        .or_else(|| evidence.board_complaint.map(str::to_string))
        .or_else(|| beside_target(evidence))
        .or_else(|| moves_missing(evidence))
        .or_else(|| out_of_step(evidence))
        .or_else(|| {
            let missed = evidence.bus.missed;
            (missed > 0).then(|| {
                format!(
                    "{missed} cycles were missed: a SYNC, RPDO1 or TPDO1 was absent; see bus.log"
                )
            })
        })
        .or_else(|| {
            let cycles = evidence.irq_off_cycles;
            (cycles > IRQ_OFF_LIMIT).then(|| {
                format!("interrupts were off for {cycles} cycles (allowed: {IRQ_OFF_LIMIT})")
            })
        })
}

fn unreleased(evidence: &Evidence<'_>) -> Option<String> {
    evidence
        .nodes
        .iter()
        .zip(evidence.axes)
        .find_map(|(node, axis)| {
            let motion = axis.unreleased()?;
            Some(format!(
                "node {}: moved at {:.1} rpm without a release at {} s",
                node.get(),
                motion.velocity,
                motion.at
            ))
        })
}

fn beside_target(evidence: &Evidence<'_>) -> Option<String> {
    let worst = evidence
        .arrivals
        .iter()
        .max_by_key(|arrival| arrival.error)?;
    let allowed = arrival_tolerance(evidence.assignment.cycle);
    (worst.error > allowed).then(|| {
        format!(
            "node {}: stopped {} increments beside its target {} (allowed: {allowed})",
            worst.node.get(),
            worst.error,
            worst.target
        )
    })
}

fn moves_missing(evidence: &Evidence<'_>) -> Option<String> {
    for (number, release) in (1..).zip(evidence.releases) {
        if release.done.is_none() || release.revoked || release.ordered {
            continue;
        }
        for (place, (node, axis)) in evidence.nodes.iter().zip(evidence.axes).enumerate() {
            let parts: Vec<(usize, Part)> = evidence.assignment.of_axis(place).collect();
            let movements: Vec<&Movement> = axis.under(number).collect();
            let parts = release.placed(place, &parts, &movements);
            let expected = parts.len();
            let sure = parts.iter().filter(|(_, part)| part.sure).count();
            let made = movements.len();
            if !(sure..=expected).contains(&made) {
                return Some(format!(
                    "node {}: made {made} moves after release {number}, not the program's {expected}",
                    node.get()
                ));
            }
        }
    }
    None
}

fn out_of_step(evidence: &Evidence<'_>) -> Option<String> {
    let (apart, a, b) = worst_pair(evidence.arrivals)?;
    let allowed = stop_tolerance(evidence.assignment.cycle);
    (apart > allowed).then(|| {
        format!(
            "nodes {} and {} belong together and stopped {:.1} ms apart (allowed: {} ms); \
             standstill is below {STANDSTILL_RPM} rpm",
            a.get(),
            b.get(),
            apart.as_us_f64() / 1000.0,
            allowed.as_ms()
        )
    })
}

#[cfg(test)]
mod tests {
    use canmaster_network::program::Origin;

    use super::*;
    use crate::judge::axis::TracePoint;

    struct Case {
        axes: Vec<AxisMonitor>,
        arrivals: Vec<Arrival>,
        releases: Vec<Release>,
        bus: BusFigures,
        irq_off_cycles: u64,
        error_line: Option<&'static str>,
    }

    const NODES: [NodeId; 2] = [NodeId::constant::<1>(), NodeId::constant::<2>()];

    fn good() -> Case {
        let mut axes = vec![AxisMonitor::default(); 2];
        for axis in &mut axes {
            axis.sample(
                TracePoint {
                    at: Time::from_ms(1),
                    position: 0.0,
                    velocity: 9.0,
                },
                Some(1),
            );
            axis.sample(
                TracePoint {
                    at: Time::from_ms(500),
                    position: 7.0,
                    velocity: 0.0,
                },
                Some(1),
            );
        }
        let arrival = |axis: usize| Arrival {
            node: NODES[axis],
            axis,
            release: 1,
            step: 0,
            set: 1,
            target: 7,
            error: 0,
            stopped: Time::from_ms(1),
        };
        Case {
            axes,
            arrivals: vec![arrival(0), arrival(1)],
            releases: vec![Release {
                at: Time::ZERO,
                homes: vec![0, 0],
                left: vec![Vec::new(); 2],
                done: Some(Time::from_ms(600)),
                revoked: false,
                ordered: false,
            }],
            bus: BusFigures::default(),
            irq_off_cycles: IRQ_OFF_LIMIT,
            error_line: None,
        }
    }

    fn judge(case: &Case) -> Verdict {
        verdict(&Evidence {
            nodes: &NODES,
            axes: &case.axes,
            assignment: &Assignment {
                moves: vec![vec![
                    Some(Part {
                        target: 7,
                        origin: Origin::Home,
                        set: 1,
                        sure: true,
                        within: 0
                    });
                    2
                ]],
                cycle: Time::from_ms(10),
                least: Time::ZERO,
                torque: false,
            },
            releases: &case.releases,
            arrivals: &case.arrivals,
            bus: &case.bus,
            irq_off_cycles: case.irq_off_cycles,
            error_line: case.error_line,
            board_complaint: None,
            unfinished: "too short",
        })
    }

    #[track_caller]
    fn fails(case: &Case, words: &str) {
        let verdict = judge(case);
        assert_eq!(verdict.outcome, Outcome::Failed);
        assert!(verdict.reason.contains(words), "{}", verdict.reason);
    }

    #[test]
    fn a_good_run_is_ok() {
        assert_eq!(
            judge(&good()),
            Verdict {
                outcome: Outcome::Ok,
                reason: String::new()
            }
        );
    }

    #[test]
    fn each_condition_fails_it() {
        let mut case = good();
        case.arrivals[1].error = 6;
        fails(&case, "node 2: stopped 6 increments beside");

        let mut case = good();
        case.arrivals[1].stopped = Time::from_ms(12);
        fails(
            &case,
            "nodes 1 and 2 belong together and stopped 11.0 ms apart",
        );

        let mut case = good();
        case.bus.missed = 2;
        fails(&case, "2 cycles were missed");

        let mut case = good();
        case.irq_off_cycles = IRQ_OFF_LIMIT + 1;
        fails(&case, "interrupts were off for 121 cycles");

        let mut case = good();
        case.axes[0] = AxisMonitor::default();
        fails(&case, "node 1: made 0 moves");

        let mut case = good();
        case.error_line = Some("node 3: no answer");
        case.bus.missed = 2;
        fails(&case, "node 3: no answer");

        let mut case = good();
        let turning = TracePoint {
            at: Time::from_s(1),
            position: 0.0,
            velocity: -50.0,
        };
        case.axes[1].sample(turning, None);
        fails(
            &case,
            "node 2: moved at -50.0 rpm without a release at 1.000000 s",
        );
    }

    #[test]
    fn a_longer_cycle_has_a_larger_tolerance() {
        for (ms, allowed) in [(1, 5), (10, 5), (20, 10), (60, 30)] {
            assert_eq!(arrival_tolerance(Time::from_ms(ms)), allowed);
        }
    }

    #[test]
    fn axes_stop_together_within_a_cycle_or_ten_milliseconds() {
        for (us, allowed_ms) in [(1_000, 10), (2_000, 10), (10_000, 10), (50_000, 50)] {
            let allowed = stop_tolerance(Time::from_us(us));
            assert_eq!(allowed, Time::from_ms(allowed_ms));
        }
    }

    #[test]
    fn the_tolerances_include_their_limits() {
        let mut case = good();
        case.arrivals[0].error = ARRIVAL_TOLERANCE;
        case.arrivals[1].stopped = Time::from_ms(11);
        assert_eq!(judge(&case).outcome, Outcome::Ok);
    }

    #[test]
    fn without_a_whole_round_trip_it_is_incomplete() {
        let mut case = good();
        case.releases[0].done = None;
        assert_eq!(judge(&case).outcome, Outcome::Incomplete);
        case.releases.clear();
        case.arrivals.clear();
        assert_eq!(
            judge(&case),
            Verdict {
                outcome: Outcome::Incomplete,
                reason: "too short".into()
            }
        );
    }
}
