//! Where a path is so slow that its axis seems to rest: turning points, long rests, a
//! soft end.

use super::Path;
use super::axes::Group;

/// An axis above this is seen to turn, rpm.
const TURNING_RPM: f64 = 5.0;
/// What a drive may be off, rpm.
const NOISE_RPM: f64 = 1.0;
/// Below it may seem to rest while it passes, rpm.
const SLOW_RPM: f64 = 8.0;
/// So long it has to be slow to be seen to rest, ms.
const SEEN_MS: f64 = 100.0;
/// Axes that stop together do so within this, ms.
const TOGETHER_MS: f64 = 10.0;
/// A little less may be seen as well.
const BARELY: f64 = 0.9;
/// What an axis is off at most where it is slow, increments.
const OFF: f64 = 10.0;
/// A period is looked at in so many moments at most.
const MOMENTS: u32 = 200_000;
/// No more periods are unrolled.
const PERIODS: u16 = 500;

/// How one axis follows a path.
#[derive(Debug, Default)]
pub(super) struct Slow {
    /// It is fast enough to be seen to turn at all.
    pub(super) seen: bool,
    /// Where it may seem to rest on the way, from where it begins, and so much beside.
    pub(super) places: Vec<(i64, u32)>,
    /// So far before its end it may seem to rest.
    pub(super) end: u32,
    /// It ends so softly that noise decides when it seems to stop.
    pub(super) soft: bool,
}

/// A moment: cycles, increments, increments per cycle.
type Moment = (f64, f64, f64);

/// From and to a time, lowest and highest position.
#[derive(Clone, Copy)]
struct Span {
    from: f64,
    to: f64,
    low: f64,
    high: f64,
}

pub(super) fn of(group: &Group, path: &Path, member: usize) -> Slow {
    let axis = path.members.get(member).map(|member| member.axis);
    let Some(axis) = axis.and_then(|axis| group.axes.get(axis)) else {
        return Slow::default();
    };
    let rpm = axis.per_rpm(group.cycle_us);
    let moments = moments(path, member);
    let Some((whole, last, _)) = moments.last().copied() else {
        return Slow::default();
    };
    let faster = |least: f64| move |moment: &&Moment| moment.2.abs() > least * rpm;
    if !moments.iter().any(|m| faster(TURNING_RPM - NOISE_RPM)(&m)) {
        return Slow::default();
    }
    let long = f64::from(group.cycles(SEEN_MS));
    let turned = moments.iter().rfind(faster(TURNING_RPM + NOISE_RPM));
    let crept = moments.iter().rfind(faster(TURNING_RPM - NOISE_RPM));
    let time = |moment: Option<&Moment>| moment.map_or(0.0, |moment| moment.0);
    let soft = time(crept) - time(turned) > f64::from(group.cycles(TOGETHER_MS));
    let rested = turned.map_or(whole, |turned| turned.0 + long);
    let end = moments.iter().filter(|moment| moment.0 >= rested);
    let end = end
        .map(|moment| (moment.1 - last).abs())
        .fold(0.0, f64::max);
    let spans = spans(&moments, SLOW_RPM * rpm);
    let is_long = |span: &&Span| span.to - span.from >= long * BARELY;
    let place = |span: &Span| {
        let within = (span.high - span.low) / 2.0 + OFF;
        (((span.high + span.low) / 2.0).round() as i64, within as u32)
    };
    let inner = |span: &&Span| span.from > 0.0 && span.to < whole;
    let on_the_way: Vec<_> = spans.iter().filter(inner).filter(is_long).collect();
    // From one period to the next.
    let between = match (spans.first(), spans.last()) {
        (Some(first), Some(last)) if first.from == 0.0 && last.to == whole => Some(Span {
            from: last.from - whole,
            to: first.to,
            low: first.low.min(last.low),
            high: first.high.max(last.high),
        }),
        _ => None,
    };
    let between = between.as_ref().filter(is_long);
    let mut places = Vec::new();
    for period in 0..path.periods.min(PERIODS) {
        places.extend(between.filter(|_| period > 0).map(place));
        places.extend(on_the_way.iter().map(|span| place(span)));
    }
    Slow {
        seen: true,
        places,
        end: end.round() as u32,
        soft,
    }
}

/// One period, from where it begins.
fn moments(path: &Path, member: usize) -> Vec<Moment> {
    let cycles = path.points.iter().map(|point| u32::from(point.cycles));
    let step = (cycles.sum::<u32>() / MOMENTS).max(1) as usize;
    let mut moments = Vec::new();
    let (mut begin, mut at, mut speed) = (0.0, 0.0, 0.0);
    for point in &path.points {
        let time = f64::from(point.cycles);
        let (to, then) = path.at(member, point);
        for cycle in (0..point.cycles).step_by(step) {
            let s = f64::from(cycle) / time;
            let way = s * s * (3.0 - 2.0 * s) * (to - at);
            let bent = s * (1.0 - s) * ((1.0 - s) * speed - s * then) * time;
            let mean = 6.0 * s * (1.0 - s) * (to - at) / time;
            let velocity = mean + (1.0 - s) * (1.0 - 3.0 * s) * speed + s * (3.0 * s - 2.0) * then;
            moments.push((begin + f64::from(cycle), at + way + bent, velocity));
        }
        (begin, at, speed) = (begin + time, to, then);
    }
    moments.push((begin, at, speed));
    moments
}

/// Where it is slower than that.
fn spans(moments: &[Moment], limit: f64) -> Vec<Span> {
    let slow = |moment: &Moment| moment.2.abs() < limit;
    let runs = moments.chunk_by(|one, next| slow(one) == slow(next));
    let slow_ones = runs.filter(|run| run.first().is_some_and(slow));
    let span = |run: &[Moment]| Span {
        from: run.first().map_or(0.0, |first| first.0),
        to: run.last().map_or(0.0, |last| last.0),
        low: run.iter().map(|moment| moment.1).fold(f64::MAX, f64::min),
        high: run.iter().map(|moment| moment.1).fold(f64::MIN, f64::max),
    };
    slow_ones.map(span).collect()
}
