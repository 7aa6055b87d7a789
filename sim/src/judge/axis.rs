//! What one axis really did: judged in the plant, not by what a drive reports.

use crate::time::Time;

/// An axis turns while it is faster than this, rpm.
pub const STANDSTILL_RPM: f64 = 5.0;
/// A stop counts once the axis has stood this long; shorter ones belong to one
/// movement (the last increments of a closed position loop).
pub const SETTLED: Time = Time::from_ms(100);
/// So long it has stood at least if it goes on after a rest.
const PAUSE: Time = Time::from_ms(5);
/// Distance of the points that are kept for pictures.
const TRACE_STEP: Time = Time::from_ms(2);

/// One movement: from standstill to standstill.
#[derive(Clone, Debug, PartialEq)]
pub struct Movement {
    /// First moment above [`STANDSTILL_RPM`].
    pub started: Time,
    /// Last moment above [`STANDSTILL_RPM`] so far.
    pub stopped: Time,
    /// The axis has stood for [`SETTLED`].
    pub settled: bool,
    /// Lowest true position since it settled, increments.
    pub rest_low: f64,
    /// Highest true position since it settled, increments.
    pub rest_high: f64,
    /// How many releases had been given when it started; 0 = none.
    pub release: usize,
}

impl Movement {
    /// The greatest distance from `target` while at rest, in whole increments.
    pub fn error(&self, target: i32) -> i64 {
        let from = |position: f64| (position.round() as i64 - i64::from(target)).abs();
        from(self.rest_low).max(from(self.rest_high))
    }
}

/// A point of a curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TracePoint {
    /// When.
    pub at: Time,
    /// True position, increments.
    pub position: f64,
    /// True velocity, rpm.
    pub velocity: f64,
}

/// Motion that nobody released.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unreleased {
    /// When it was seen first.
    pub at: Time,
    /// True velocity then, rpm.
    pub velocity: f64,
}

/// Watches one axis.
#[derive(Clone, Debug, Default)]
pub struct AxisMonitor {
    movements: Vec<Movement>,
    travelled: f64,
    last: Option<TracePoint>,
    unreleased: Option<Unreleased>,
    trace: Vec<TracePoint>,
    /// A movement that went on after a rest which was too short to end it: when it had
    /// stopped, and when it went on.
    resumed: Option<(Time, Time)>,
}

impl AxisMonitor {
    /// Takes in the truth at a moment. `release` is the number of the release
    /// under which motion is allowed now, if it is.
    pub fn sample(&mut self, now: TracePoint, release: Option<usize>) {
        if let Some(last) = self.last {
            self.travelled += (now.position - last.position).abs();
        }
        self.last = Some(now);
        if self
            .trace
            .last()
            .is_none_or(|point| now.at >= point.at + TRACE_STEP)
        {
            self.trace.push(now);
        }
        if now.velocity.abs() > STANDSTILL_RPM {
            self.turning(now, release);
        } else {
            self.standing(now);
        }
    }

    fn turning(&mut self, now: TracePoint, release: Option<usize>) {
        if release.is_none() && self.unreleased.is_none() {
            self.unreleased = Some(Unreleased {
                at: now.at,
                velocity: now.velocity,
            });
        }
        match self.movements.last_mut() {
            Some(movement) if !movement.settled => {
                if now.at > movement.stopped + PAUSE {
                    self.resumed = Some((movement.stopped, now.at));
                }
                movement.stopped = now.at;
            }
            _ => self.movements.push(Movement {
                started: now.at,
                stopped: now.at,
                settled: false,
                rest_low: now.position,
                rest_high: now.position,
                release: release.unwrap_or(0),
            }),
        }
    }

    fn standing(&mut self, now: TracePoint) {
        let Some(movement) = self.movements.last_mut() else {
            return;
        };
        if movement.settled {
            movement.rest_low = movement.rest_low.min(now.position);
            movement.rest_high = movement.rest_high.max(now.position);
        } else if now.at >= movement.stopped + SETTLED {
            movement.settled = true;
            movement.rest_low = now.position;
            movement.rest_high = now.position;
        }
    }

    /// What it does from now on is another movement, if it stands now, however shortly. If
    /// it has gone on for a moment only, that is no part of the movement: an axis which is to
    /// change its mode is told to stay where it is, some increments beside its target.
    pub fn divide(&mut self) {
        let Some(now) = self.last else { return };
        let movement = self.movements.last_mut();
        let Some(movement) = movement.filter(|movement| !movement.settled) else {
            return;
        };
        let turns = now.velocity.abs() > STANDSTILL_RPM;
        let shortly =
            |(_, at): &(Time, Time)| *at > movement.started && movement.stopped.since(*at) < PAUSE;
        match self.resumed.filter(shortly) {
            Some((stopped, _)) => movement.stopped = stopped,
            None if turns => return,
            None => {}
        }
        movement.settled = true;
        movement.rest_low = now.position;
        movement.rest_high = now.position;
    }

    /// Every movement so far.
    pub fn movements(&self) -> &[Movement] {
        &self.movements
    }

    /// Those that began under a release, by its number.
    pub fn under(&self, release: usize) -> impl Iterator<Item = &Movement> {
        let all = self.movements.iter();
        all.filter(move |movement| movement.release == release)
    }

    /// The way behind it, forth and back added up, increments.
    pub fn travelled(&self) -> f64 {
        self.travelled
    }

    /// Last moment of turning: the issue's *stopped*.
    pub fn stopped(&self) -> Option<Time> {
        self.movements.last().map(|movement| movement.stopped)
    }

    /// No movement is going on.
    pub fn at_rest(&self) -> bool {
        self.movements
            .last()
            .is_none_or(|movement| movement.settled)
    }

    /// The first motion that nobody released.
    pub fn unreleased(&self) -> Option<Unreleased> {
        self.unreleased
    }

    /// The curve.
    pub fn trace(&self) -> &[TracePoint] {
        &self.trace
    }

    /// The newest truth.
    pub fn last(&self) -> Option<TracePoint> {
        self.last
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(ms: u64, position: f64, velocity: f64) -> TracePoint {
        TracePoint {
            at: Time::from_ms(ms),
            position,
            velocity,
        }
    }

    #[test]
    fn stopped_is_the_last_moment_above_five_rpm() {
        let mut axis = AxisMonitor::default();
        axis.sample(at(0, 0.0, 0.0), None);
        axis.sample(at(10, 10.0, 100.0), Some(1));
        axis.sample(at(20, 20.0, 5.1), Some(1));
        axis.sample(at(30, 21.0, 5.0), Some(1));
        axis.sample(at(40, 21.0, -5.2), Some(1));
        for ms in 5..30 {
            axis.sample(at(ms * 10, 20.0, 0.5), Some(1));
        }
        assert_eq!(
            axis.movements().len(),
            1,
            "a short rest does not end a movement"
        );
        assert_eq!(axis.stopped(), Some(Time::from_ms(40)));
        assert!(axis.at_rest());
        assert_eq!(axis.unreleased(), None);
        assert_eq!(axis.travelled(), 22.0);
        assert_eq!(axis.movements()[0].release, 1);
    }

    /// The last increments of another mode are no part of the movement before.
    #[test]
    fn what_begins_as_it_is_divided_is_another_movement() {
        let mut axis = AxisMonitor::default();
        let turn = |axis: &mut AxisMonitor, ms, velocity| {
            axis.sample(at(ms, 1000.0, velocity), Some(1));
        };
        for (ms, velocity) in [(0, 100.0), (1, 50.0), (2, 0.0), (60, 0.0), (61, 9.0)] {
            turn(&mut axis, ms, velocity);
        }
        axis.divide();
        let ended = axis.movements()[0].clone();
        assert_eq!((ended.stopped, ended.settled), (Time::from_ms(1), true));
        turn(&mut axis, 62, 9.0);
        assert_eq!(axis.movements().len(), 2);
        // On its way nothing is divided.
        for ms in 63..80 {
            turn(&mut axis, ms, 9.0);
        }
        axis.divide();
        assert!(!axis.at_rest());
    }

    #[test]
    fn creeping_away_after_the_stop_counts_as_error() {
        let mut axis = AxisMonitor::default();
        axis.sample(at(0, 1000.0, 50.0), Some(1));
        axis.sample(at(200, 1001.0, 0.0), Some(1));
        axis.sample(at(300, 1007.4, 0.0), Some(1));
        axis.sample(at(400, 1000.0, 0.0), Some(1));
        let movement = &axis.movements()[0];
        assert_eq!(movement.error(1000), 7);
        assert_eq!(movement.error(1007), 7);
    }

    #[test]
    fn motion_without_release_is_seen() {
        let mut axis = AxisMonitor::default();
        axis.sample(at(0, 0.0, 4.9), None);
        assert_eq!(axis.unreleased(), None);
        axis.sample(at(10, 0.0, -5.1), None);
        axis.sample(at(20, 0.0, -90.0), None);
        assert_eq!(
            axis.unreleased(),
            Some(Unreleased {
                at: Time::from_ms(10),
                velocity: -5.1
            })
        );
    }

    #[test]
    fn the_trace_is_thinned_out() {
        let mut axis = AxisMonitor::default();
        for us in 0..10_000 {
            axis.sample(
                TracePoint {
                    at: Time::from_us(us),
                    position: 0.0,
                    velocity: 0.0,
                },
                None,
            );
        }
        assert_eq!(axis.trace().len(), 5);
    }
}
