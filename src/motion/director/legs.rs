//! From the steps of a program and from single moves to the paths of the group.

use super::format::{RELATIVE, Step};
use super::{Director, LATER_MAX, LEAD, Phase, format};
use crate::motion::Scale;
use crate::motion::group::{Group, SetPoint};
use crate::motion::mode::Mode;
use crate::motion::program::{AxisMove, Judged, Reason, Refusal, Refused, TORQUE};
use crate::motion::{fixed, next, plan};

/// Points of a path that are handed over in one look, since the group waits.
const POINTS: usize = 2;
/// Cycles until new ramps are in the drives, and two for each axis: RPDO2 goes to one in a
/// cycle, where nothing of higher priority has its place.
const SENT: u32 = 8;
/// Cycles in which a drive shows the velocity of its next set-point.
const PATIENCE: u32 = 1000;

impl<const N: usize> Director<N> {
    pub(super) fn clear(&mut self) {
        for leg in &mut self.legs {
            leg.set = None;
        }
        self.set_points = 0;
    }

    /// The legs of a step.
    pub(super) fn set_legs(&mut self, group: &Group<N>, step: &Step<'_>) -> Result<bool, Refused> {
        self.clear();
        let (mut left, mut member) = (step.axes, 0);
        while let Some(axis) = next(&mut left) {
            let part = step.part(member);
            self.set_leg(group, axis, &part, step.has(RELATIVE), step.value)?;
            member += 1;
        }
        Ok(false)
    }

    /// The leg of an axis, checked against its limits.
    #[inline(never)]
    pub(super) fn set_leg(
        &mut self,
        group: &Group<N>,
        axis: usize,
        part: &AxisMove,
        relative: bool,
        jerk: u32,
    ) -> Judged {
        let (Some(limits), Some(of), Some(leg)) = (
            self.limits().get(axis),
            group.axis(axis),
            self.legs.get_mut(axis),
        ) else {
            return Ok(());
        };
        let why = &mut self.error;
        *why = Refusal::NONE;
        why.axis = axis as u8;
        let mode = of.mode();
        let torque = mode == Mode::CyclicTorque;
        let marked = part.set & TORQUE != 0;
        // The numbers of a program may mean something else in this mode; and in that of
        // homing nothing follows a target.
        if self.running && torque != marked || mode == Mode::Homing {
            let allowed = match marked {
                true => Mode::CyclicTorque,
                false => Mode::ProfileVelocity,
            };
            return why.because(Reason::WrongMode, mode as u32, allowed as u32);
        }
        let mut home = of.home;
        let mut scale = limits.scale;
        if torque {
            home = 0;
            scale = scale.of_units();
        } else if mode == Mode::ProfilePosition {
            scale = Scale::NONE;
            self.until = group.count().wrapping_add(PATIENCE);
        }
        let mut target = part.target;
        if relative {
            let end = fixed::round(of.path.end());
            target = target.saturating_add(end.wrapping_sub(home));
        }
        part.keeps(torque, limits, why)?;
        limits.takes(target, torque, why)?;
        leg.set = Some(part.set);
        leg.target = target.wrapping_add(home);
        [leg.velocity, leg.acceleration, leg.deceleration] = part.limits(scale);
        leg.jerk = scale.per_cycle(scale.acceleration(jerk as f32));
        Ok(())
    }

    /// Where the paths will stand when the plan begins, and who gets a set-point; `false`
    /// if a drive has not taken its last one yet, or not what the next one needs.
    #[inline(never)]
    pub(super) fn predict(
        &mut self,
        group: &mut Group<N>,
        step: &Step<'_>,
    ) -> Result<bool, Refused> {
        let lead = LEAD + self.later;
        self.start = group.count().wrapping_add(lead);
        let here = group.here();
        let mut ready = true;
        for (axis, leg) in self.legs.iter_mut().enumerate() {
            let Some(of) = group.axis_mut(axis) else {
                break;
            };
            let mode = of.mode();
            leg.home = of.home;
            leg.from = of.path.ahead(lead - 1);
            if self.path {
                if step.axes >> axis & 1 != 0 && !mode.has_position() {
                    // Its drive moves it by itself, or it is no motion.
                    self.error.axis = axis as u8;
                    let (mode, allowed) = (mode as u32, Mode::WITH_POSITION);
                    self.error.because(Reason::Mode, mode, allowed)?;
                }
            } else if mode == Mode::ProfilePosition {
                if leg.set.take().is_some() {
                    // One that is left out is told nothing.
                    self.set_points |= here & 1 << axis;
                }
                if self.set_points >> axis & 1 == 0 {
                    continue;
                }
                if !of.takes_set_points() {
                    self.until = self.start.wrapping_add(PATIENCE);
                    ready = false;
                    continue;
                }
                // Its drive counts as people do.
                let profile = [leg.velocity, leg.acceleration, leg.deceleration];
                let profile = profile.map(|value| value as u32);
                if !of.prepare(profile, SENT + 2 * N as u32) {
                    ready = false;
                    if self.start.wrapping_sub(self.until) as i32 >= 0 {
                        self.error.axis = axis as u8;
                        self.error.because(Reason::NotShown, profile[0], 0)?;
                    }
                }
            }
        }
        Ok(ready)
    }

    /// Plans what there is to plan, and checks it against the travel from where the
    /// axes are.
    pub fn think(&mut self, program: &[u8]) {
        let step = Step::at(format::steps(program), self.at);
        self.phase = Phase::Planned;
        let result = self.plan(&step);
        self.judge(result);
    }

    fn plan(&mut self, step: &Step<'_>) -> Result<bool, Refused> {
        let limits = self.limits();
        let why = &mut self.error;
        if !self.path
            && let Err(axis) = plan::plan(&mut self.legs)
        {
            why.axis = axis;
            why.because(Reason::Time, u32::MAX, plan::CYCLES_MAX)?;
        }
        let mut member = 0;
        let all = self.legs.iter_mut().zip(limits);
        for (axis, (leg, limits)) in (0..).zip(all) {
            why.axis = axis;
            let from = fixed::round(leg.from.position).wrapping_sub(leg.home);
            if !self.path {
                if leg.set.is_some() && leg.turn != 0.0 {
                    limits.reaches(from.saturating_add(leg.turn as i32), why)?;
                }
            } else if step.axes >> axis & 1 != 0 {
                let told = step.begin(member);
                if !step.has(RELATIVE) && from != told {
                    why.because(Reason::Begin, from as u32, told as u32)?;
                }
                let slope = step.check_path(member, limits, Some(from), why)?;
                (leg.up, leg.down) = (slope, slope);
                member += 1;
            }
        }
        Ok(true)
    }

    /// Hands the plan over. Too late for its first step, it is made anew.
    pub fn act(&mut self, group: &mut Group<N>, program: &[u8]) {
        match self.phase {
            Phase::Failed => return self.give_up(group),
            Phase::Planned => {}
            _ => return,
        }
        let step = Step::at(format::steps(program), self.at);
        let mut axes = step.axes;
        if !self.path {
            axes = 0;
            for (axis, leg) in self.legs.iter().enumerate() {
                axes |= u32::from(leg.set.is_some()) << axis;
            }
        }
        // A path begins at rest: the sooner, the better.
        let start = if self.path {
            group.count().wrapping_add(1)
        } else {
            self.start
        };
        if group.announce(start, axes).is_err() {
            self.later = LATER_MAX.min(self.later * 2 + LEAD);
            self.phase = Phase::Plan;
            return;
        }
        let set_points = if self.path { 0 } else { self.set_points };
        let after = start.wrapping_sub(group.count());
        for (axis, leg) in self.legs.iter().enumerate() {
            if (axes | set_points) >> axis & 1 == 0 {
                continue;
            }
            if set_points >> axis & 1 != 0 {
                let set_point = SetPoint {
                    target: leg.target,
                    immediately: !self.after,
                    relative: self.running && step.has(RELATIVE),
                    after,
                };
                // It can take one, as the prediction has found.
                group.ask(axis, &set_point);
                continue;
            }
            group.set_ramps(axis, leg.up, leg.down);
            if !self.path {
                for knot in &leg.knots {
                    group.push(axis, knot);
                }
            }
        }
        self.phase = Phase::Arriving;
        if self.path {
            (self.point, self.period) = (0, 0);
            self.phase = Phase::Path;
            self.feed(group, &step);
        }
    }

    /// Hands over the next points of a path, if there is room.
    pub(super) fn feed(&mut self, group: &mut Group<N>, step: &Step<'_>) {
        for _ in 0..POINTS {
            if self.period == step.periods() {
                self.phase = Phase::Arriving;
                return;
            }
            let (mut left, mut member) = (step.axes, 0);
            while let Some(axis) = next(&mut left) {
                if group.room(axis) == 0 {
                    return;
                }
                let mut knot = step.point(member, self.point);
                let begin = self.legs.get(axis).map_or(0, |leg| leg.from.position);
                knot.position = knot.position.wrapping_add(begin);
                group.push(axis, &knot);
                member += 1;
            }
            self.point += 1;
            if self.point == step.points() {
                self.point = 0;
                self.period += 1;
            }
        }
    }
}
