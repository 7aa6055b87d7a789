//! Moves: from where the axes are to targets, in sets that arrive together.

use toml::Spanned;

use super::Reader;
use crate::problem::Place;
use crate::program::axes::TORQUE;
use crate::program::{Move, Part};
use crate::program::{description, timing};

/// rpm/s^2
const JERK_MAX: i64 = 1_000_000_000;

impl Reader<'_> {
    pub(super) fn moves(
        &mut self,
        moves: &[Spanned<description::Move>],
        jerk: Option<&Spanned<i64>>,
        place: &Place,
    ) -> Option<Move> {
        let jerk = match jerk {
            Some(jerk) => self.context.number(jerk, "jerk", 0..=JERK_MAX)?,
            None => 0,
        };
        let relative = moves.iter().any(|one| one.get_ref().by.is_some());
        let mut out = Move {
            relative,
            jerk,
            ..Move::default()
        };
        if moves.is_empty() {
            let rule = "nothing is moved".to_string();
            self.error(
                place,
                "move",
                rule,
                "add [[step.move]] with axes and to or by",
            );
            return None;
        }
        // From home, where it is not known.
        let from = self.known.iter().map(|known| known.at.unwrap_or(0));
        let from: Vec<i64> = from.collect();
        let mut complete = true;
        for (set, one) in (1..).zip(moves) {
            complete &= self.set(one, set, &mut out).is_some();
            complete = complete && self.in_time(one, set, &out, &from).is_some();
        }
        out.parts.sort_by_key(|part| part.axis);
        complete.then_some(out)
    }

    /// A set does not take longer than the firmware can plan.
    fn in_time(
        &mut self,
        one: &Spanned<description::Move>,
        set: u8,
        of: &Move,
        from: &[i64],
    ) -> Option<()> {
        let most = timing::CYCLES_MAX;
        let own = of.parts.iter().copied();
        let parts = own.filter(|part| part.set == set).collect();
        let relative = of.relative;
        let jerk = of.jerk;
        let alone = Move {
            relative,
            jerk,
            parts,
            ..Move::default()
        };
        let cycles = timing::cycles(self.group, &alone, from);
        if cycles <= u64::from(most) {
            return Some(());
        }
        let place = self.context.at(one);
        let rule = format!(
            "a move takes at most {most} cycles of {} us",
            self.group.cycle_us
        );
        let help = "make it faster, or divide the way between several steps";
        self.error(&place, format!("{cycles} cycles"), rule, help);
        None
    }

    /// Axes that arrive together.
    fn set(&mut self, one: &Spanned<description::Move>, set: u8, out: &mut Move) -> Option<()> {
        let place = self.context.at(one);
        let one = one.get_ref();
        let members = self.members(one.axes.as_ref())?;
        let (values, key) = match (&one.to, &one.by) {
            (Some(to), None) if !out.relative => (to, "to"),
            (None, Some(by)) => (by, "by"),
            _ => {
                let rule = "a step moves its axes either to positions or by distances";
                let help = "give each move of the step `to`, or give each `by`";
                self.error(&place, "move", rule.to_string(), help);
                return None;
            }
        };
        let where_to = self.context.at(values);
        let numbers = self.values(values, key, members.len())?;
        let file = self.file;
        let of = |own, of_file, key, reader: &mut Self| {
            reader.ramps(own, of_file, key, &members, &place)
        };
        let velocity = of(
            one.velocity.as_ref(),
            file.velocity.as_ref(),
            "velocity",
            self,
        );
        let up = of(
            one.acceleration.as_ref(),
            file.acceleration.as_ref(),
            "acceleration",
            self,
        );
        let (velocity, up) = (velocity?, up?);
        let own = one.deceleration.as_ref();
        let down = match own.or(file.deceleration.as_ref()) {
            // As steep as it speeds up.
            None => up.clone(),
            given => of(given, None, "deceleration", self)?,
        };
        for (member, axis) in members.iter().copied().enumerate() {
            if out.parts.iter().any(|part| part.axis == axis) {
                let name = self.group.axes.get(axis)?.name.clone();
                let rule = "an axis is moved twice in one step".to_string();
                self.error(&place, name, rule, "remove it from one of the moves");
                return None;
            }
            let value = *numbers.get(member)?;
            let (target, mark) = if self.is_torque(axis) {
                (self.torque(axis, value, &where_to)?, TORQUE)
            } else {
                (self.target(axis, value, out.relative, &where_to)?, 0)
            };
            out.parts.push(Part {
                axis,
                target,
                velocity: *velocity.get(member)?,
                acceleration: *up.get(member)?,
                deceleration: *down.get(member)?,
                set: set | mark,
            });
        }
        Some(())
    }

    fn target(&mut self, axis: usize, value: f64, relative: bool, place: &Place) -> Option<i32> {
        let target = *self
            .increments(&[value], &[axis], place, relative)?
            .first()?;
        let known = self.known.get_mut(axis)?;
        let at = match relative {
            true => known.at.map(|at| at.saturating_add(target)),
            false => Some(target),
        };
        known.at = at;
        // From anywhere, the way has to fit into the travel at all.
        let of = self.group.axes.get(axis)?;
        let longest = i64::from(of.travel.1) - i64::from(of.travel.0);
        let checked = match at {
            Some(at) => at,
            None if target.abs() > longest => target,
            None => 0,
        };
        self.travel(axis, checked, place)?;
        i32::try_from(target).ok()
    }
}
