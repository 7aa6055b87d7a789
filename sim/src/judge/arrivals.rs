//! Who arrived where: movements in the plant against the program's targets.

use canmaster::NodeId;
use canmaster_network::program::Origin;

use super::axis::{AxisMonitor, Movement};
use crate::time::Time;

/// So near to a place where it may rest, in increments, an axis rests there.
const NEAR: i64 = 50;
/// In that time an axis goes nowhere and back: another mode holds it some increments
/// beside.
const BRIEF: Time = Time::from_ms(50);

/// What one move asks of one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// Increments from its origin; the axis' home is where it stood when it was enabled.
    pub target: i32,
    /// What they count from.
    pub origin: Origin,
    /// Axes of one set start and stop together.
    pub set: u8,
    /// It is seen to rest there; else its next part may begin at once.
    pub sure: bool,
    /// So many increments beside the target it may seem to rest: it is slow there.
    pub within: u32,
}

/// What the firmware's program asks of the axes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Assignment {
    /// The parts of each move by axis; an axis without one rests. All moves,
    /// one after the other, make a round trip.
    pub moves: Vec<Vec<Option<Part>>>,
    /// SYNC period: axes of one set have to stop within it.
    pub cycle: Time,
    /// A release is not over before, however the axes stand meanwhile; 0: it is as soon
    /// as they have made all of their moves.
    pub least: Time,
    /// Axes are driven by torque, which is no move: a release is not over before the
    /// firmware says so.
    pub torque: bool,
}

impl Assignment {
    /// The moves of one axis: their places in the program and its parts.
    pub fn of_axis(&self, axis: usize) -> impl Iterator<Item = (usize, Part)> + '_ {
        self.moves
            .iter()
            .enumerate()
            .filter_map(move |(step, parts)| {
                parts.get(axis).copied().flatten().map(|part| (step, part))
            })
    }
}

/// Where an axis was when it left a mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Left {
    /// When that was.
    pub at: Time,
    /// Increments.
    pub position: i32,
}

/// A release: what the operator gave with the button.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Release {
    /// When the button was pressed.
    pub at: Time,
    /// Where each axis stood when it was enabled, increments.
    pub homes: Vec<i32>,
    /// Where each axis was each time that it left cyclic synchronous torque mode.
    pub left: Vec<Vec<Left>>,
    /// When every axis had come to rest after its last move.
    pub done: Option<Time>,
    /// It was taken back before that: the stop button, a reset, a fault.
    pub revoked: bool,
    /// Another tool gave it: where the axes go is not known here.
    pub ordered: bool,
}

impl Release {
    /// The parts of an axis, all from its home, as far as it is known where it was left:
    /// without those for which it was left where they lead to and has not moved. The
    /// movements are those under this release.
    pub fn placed(
        &self,
        axis: usize,
        parts: &[(usize, Part)],
        movements: &[&Movement],
    ) -> Vec<(usize, Part)> {
        let home = self.homes.get(axis).copied().unwrap_or(0);
        let left = |time: usize| self.left.get(axis)?.get(time);
        let mut placed = Vec::new();
        for (place, &(step, part)) in parts.iter().enumerate() {
            let mut from_home = part;
            from_home.origin = Origin::Home;
            if let Origin::Left(time) = part.origin
                && let Some(left) = left(time)
            {
                let from = left.position.wrapping_sub(home);
                from_home.target = part.target.wrapping_add(from);
            }
            if let Origin::HomeFromAnywhere { left: time, by } = part.origin
                && let Some(from) = left(time)
            {
                let before = parts.iter().take(place);
                let before = before.filter(|(_, part)| part.origin == Origin::Left(time));
                let before = before.filter(|(_, part)| part.sure).count();
                let target = home.wrapping_add(part.target);
                let until = left(time + 1).map_or(Time::MAX, |next| next.at);
                let mut since = movements.iter().filter(|made| made.started >= from.at);
                let made = since.nth(before).filter(|made| made.started < until);
                let gone = made.is_some_and(|made| made.error(target) <= NEAR);
                let begin = from.position.wrapping_add(by);
                let way = i64::from(target) - i64::from(begin);
                if way.abs() <= NEAR && !gone {
                    continue;
                }
            }
            placed.push((step, from_home));
        }
        placed
    }
}

/// One axis at the end of one move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Arrival {
    /// The drive.
    pub node: NodeId,
    /// Place of the axis in the network.
    pub axis: usize,
    /// Which release it belongs to, from 1.
    pub release: usize,
    /// Which move of the program, from 0.
    pub step: usize,
    /// Axes of one set start and stop together.
    pub set: u8,
    /// Where it should be, increments.
    pub target: i32,
    /// Greatest distance of the true position from there, or from where it may seem to
    /// rest, while at rest.
    pub error: i64,
    /// Last moment above 5 rpm.
    pub stopped: Time,
}

/// Which of its `parts` an axis at `home` has made with each of its movements. One that
/// ends at no place between is the next that is sure, but for some increments where it
/// stands. Where it passes slowly, or goes on soon, it may have seemed to rest or not; if
/// the program is `over`, its last movement led to the end.
pub fn matched<'m>(
    movements: impl Iterator<Item = &'m Movement>,
    parts: &[(usize, Part)],
    home: i32,
    over: bool,
) -> Vec<(&'m Movement, usize, Part)> {
    let mut left = parts;
    let mut all = Vec::new();
    for movement in movements.filter(|movement| movement.settled) {
        let sure = left.iter().position(|(_, part)| part.sure);
        let next = &left[..sure.map_or(left.len(), |sure| sure + 1)];
        let near = |part: &Part| {
            let error = movement.error(home.wrapping_add(part.target));
            error <= NEAR.max(part.within.into())
        };
        let made = next.iter().position(|(_, part)| near(part));
        let stood = all
            .last()
            .map_or(0, |(_, _, part): &(_, _, Part)| part.target);
        let brief = movement.stopped.since(movement.started) < BRIEF;
        if made.is_none() && brief && movement.error(home.wrapping_add(stood)) <= NEAR {
            continue;
        }
        let made = made.unwrap_or(next.len().saturating_sub(1));
        let Some(&(step, part)) = left.get(made) else {
            break;
        };
        all.push((movement, step, part));
        left = &left[made + 1..];
    }
    if over
        && let (Some(made), Some((&(step, part), between))) = (all.last_mut(), left.split_last())
        && !made.2.sure
        && !between.iter().any(|(_, part)| part.sure)
        && made.0.error(home.wrapping_add(part.target)) <= NEAR.max(part.within.into())
    {
        (made.1, made.2) = (step, part);
    }
    all
}

/// All arrivals in the order of their releases, moves and axes.
pub fn arrivals(
    nodes: &[NodeId],
    axes: &[AxisMonitor],
    assignment: &Assignment,
    releases: &[Release],
) -> Vec<Arrival> {
    let mut all = Vec::new();
    for (number, release) in (1..).zip(releases) {
        if release.revoked || release.ordered {
            continue;
        }
        for (axis, (monitor, &node)) in axes.iter().zip(nodes).enumerate() {
            let movements: Vec<&Movement> = monitor.under(number).collect();
            let Some(&home) = release.homes.get(axis) else {
                continue;
            };
            let parts: Vec<(usize, Part)> = assignment.of_axis(axis).collect();
            let parts = release.placed(axis, &parts, &movements);
            let movements = movements.into_iter();
            for (movement, step, part) in matched(movements, &parts, home, release.done.is_some()) {
                let target = home.wrapping_add(part.target);
                all.push(Arrival {
                    node,
                    axis,
                    release: number,
                    step,
                    set: part.set,
                    target,
                    error: (movement.error(target) - i64::from(part.within)).max(0),
                    stopped: movement.stopped,
                });
            }
        }
    }
    all.sort_by_key(|arrival| (arrival.release, arrival.step, arrival.axis));
    all
}

/// The greatest distance in time between the stops of axes that belong
/// together in one move, and the two drives.
pub fn worst_pair(arrivals: &[Arrival]) -> Option<(Time, NodeId, NodeId)> {
    let mut worst: Option<(Time, NodeId, NodeId)> = None;
    for (n, a) in arrivals.iter().enumerate() {
        for b in &arrivals[n + 1..] {
            if (a.release, a.step, a.set) != (b.release, b.step, b.set) {
                continue;
            }
            let apart = a.stopped.since(b.stopped).max(b.stopped.since(a.stopped));
            if worst.is_none_or(|(most, ..)| apart > most) {
                worst = Some((apart, a.node, b.node));
            }
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::judge::axis::TracePoint;

    /// Turns from `from` to `to` under `release`, in 300 ms, and rests.
    fn drive(axis: &mut AxisMonitor, start_ms: u64, from: f64, to: f64, release: usize) {
        for ms in 0..1000 {
            let share = (ms as f64 / 300.0).min(1.0);
            axis.sample(
                TracePoint {
                    at: Time::from_ms(start_ms + ms),
                    position: from + (to - from) * share,
                    velocity: if ms < 300 { 1000.0 } else { 0.0 },
                },
                Some(release),
            );
        }
    }

    fn assignment() -> Assignment {
        let both = |target| {
            vec![
                Some(Part {
                    target,
                    origin: Origin::Home,
                    set: 1,
                    sure: true,
                    within: 0,
                });
                2
            ]
        };
        Assignment {
            moves: vec![both(20_000), both(0)],
            cycle: Time::from_ms(10),
            least: Time::ZERO,
            torque: false,
        }
    }

    fn done(at_ms: u64) -> Release {
        let done = Some(Time::from_ms(at_ms + 3000));
        Release {
            at: Time::from_ms(at_ms),
            homes: vec![100, 100],
            left: vec![Vec::new(); 2],
            done,
            revoked: false,
            ordered: false,
        }
    }

    #[test]
    fn every_move_of_every_release_has_its_target() {
        let nodes = [NodeId::constant::<1>(), NodeId::constant::<2>()];
        let mut axes = [AxisMonitor::default(), AxisMonitor::default()];
        for (axis, late) in axes.iter_mut().zip([0, 4]) {
            drive(axis, 1000 + late, 100.0, 20_103.0, 1);
            drive(axis, 2000 + late, 20_103.0, 100.0, 1);
            drive(axis, 5000 + late, 100.0, 20_100.0, 2);
        }
        let all = arrivals(&nodes, &axes, &assignment(), &[done(900), done(4900)]);
        let summary: Vec<_> = all
            .iter()
            .map(|a| (a.release, a.step, a.axis, a.error))
            .collect();
        assert_eq!(
            summary,
            [
                (1, 0, 0, 3),
                (1, 0, 1, 3),
                (1, 1, 0, 0),
                (1, 1, 1, 0),
                (2, 0, 0, 0),
                (2, 0, 1, 0)
            ]
        );
        assert_eq!(
            worst_pair(&all),
            Some((Time::from_ms(4), nodes[0], nodes[1]))
        );
    }

    #[test]
    fn where_the_next_step_begins_at_once_an_axis_may_rest_or_not() {
        let part = |target, sure| Part {
            target,
            origin: Origin::Home,
            set: 1,
            sure,
            within: 0,
        };
        let parts = [
            part(500, false),
            part(900, false),
            part(200, true),
            part(0, true),
        ];
        let parts: Vec<(usize, Part)> = parts.into_iter().enumerate().collect();
        let steps = |stops: &[f64]| -> Vec<usize> {
            let mut axis = AxisMonitor::default();
            let mut from = 100.0;
            for (n, to) in (1..).zip(stops) {
                drive(&mut axis, 2000 * n, from, *to, 1);
                from = *to;
            }
            let movements = axis.movements().iter();
            let matched = matched(movements, &parts, 100, true);
            matched.into_iter().map(|(_, step, _)| step).collect()
        };
        assert_eq!(steps(&[300.0, 100.0]), [2, 3]);
        assert_eq!(steps(&[600.0, 1000.0, 300.0, 100.0]), [0, 1, 2, 3]);
        assert_eq!(steps(&[1003.0, 300.0]), [1, 2]);
        // Nowhere: beside the next that is sure.
        assert_eq!(steps(&[750.0, 100.0, 400.0]), [2, 3]);
    }

    #[test]
    fn where_an_axis_is_slow_it_may_seem_to_rest_or_not() {
        let part = |target, sure, within| Part {
            target,
            origin: Origin::Home,
            set: 1,
            sure,
            within,
        };
        // There and back twice.
        let parts = [
            part(900, false, 80),
            part(0, false, 80),
            part(900, false, 80),
            part(0, true, 2),
        ];
        let parts: Vec<(usize, Part)> = parts.into_iter().enumerate().collect();
        let steps = |stops: &[f64], over: bool| -> Vec<usize> {
            let mut axis = AxisMonitor::default();
            let mut from = 100.0;
            for (n, to) in (1..).zip(stops) {
                drive(&mut axis, 2000 * n, from, *to, 1);
                from = *to;
            }
            let movements = axis.movements().iter();
            let matched = matched(movements, &parts, 100, over);
            matched.into_iter().map(|(_, step, _)| step).collect()
        };
        assert_eq!(steps(&[930.0, 100.0, 1000.0, 100.0], true), [0, 1, 2, 3]);
        assert_eq!(steps(&[1070.0], false), [0]);
        assert_eq!(steps(&[1000.0, 100.0], false), [0, 1]);
        assert_eq!(steps(&[1000.0, 100.0], true), [0, 3]);
        assert_eq!(steps(&[100.0], true), [3]);
        // Elsewhere it must not rest: far beside its end.
        assert_eq!(steps(&[600.0], true), [3]);
    }

    #[test]
    fn a_revoked_release_has_no_arrivals() {
        let nodes = [NodeId::constant::<1>()];
        let mut axes = [AxisMonitor::default()];
        drive(&mut axes[0], 1000, 0.0, 9_000.0, 1);
        let revoked = Release {
            revoked: true,
            ..done(900)
        };
        assert!(arrivals(&nodes, &axes, &assignment(), &[revoked]).is_empty());
        assert_eq!(worst_pair(&[]), None);
    }
}
