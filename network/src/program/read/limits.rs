//! Values against the limits of an axis.

use toml::Spanned;

use super::Reader;
use crate::problem::Place;
use crate::program::Path;
use crate::program::axes::{CYCLIC_TORQUE, TORQUE_MAX};
use crate::program::description::Values;

/// As fast as a torque may change, per mille/s: what there is room for.
const RATE_MAX: u32 = (1 << 24) - 1;

/// What single precision may make of a limit in the firmware, relative.
const ROUNDING: f64 = 1.0 + 1e-4;

impl Reader<'_> {
    /// A speed or a ramp for each member, 1 to what `most` says of the axis.
    pub(super) fn ramps(
        &mut self,
        own: Option<&Spanned<Values>>,
        of_file: Option<&Spanned<Values>>,
        key: &str,
        members: &[usize],
        place: &Place,
    ) -> Option<Vec<u32>> {
        let Some(values) = own.or(of_file) else {
            let rule = format!("nobody says the {key}");
            let help = format!("add {key}, here or at the top of the file for all");
            self.error(place, key, rule, &help);
            return None;
        };
        // For the whole file it is one number.
        let all = self.values(values, key, members.len())?;
        let place = self.context.at(values);
        let mut out = Vec::new();
        for (axis, value) in members.iter().zip(all) {
            let torque = self.is_torque(*axis);
            let axis = self.group.axes.get(*axis)?;
            let (most, unit, from) = match key {
                "velocity" if torque => (RATE_MAX, "per mille/s", "format"),
                _ if torque => (u32::MAX, "per mille/s^2", "format"),
                "velocity" => (axis.velocity_max, "rpm", "max_speed"),
                _ => (axis.acceleration_max, "rpm/s", "max_acceleration"),
            };
            if value < 1.0 || value > f64::from(most) {
                let rule = format!(
                    "{key} of \"{}\" must be 1 ..= {most} {unit} (its {from})",
                    axis.name
                );
                let help = format!("write at most {most}");
                self.error(&place, value, rule, &help);
                return None;
            }
            out.push(value as u32);
        }
        Some(out)
    }

    /// Increments for each member, and whether nothing was rounded.
    pub(super) fn increments(
        &mut self,
        values: &[f64],
        members: &[usize],
        place: &Place,
        relative: bool,
    ) -> Option<Vec<i64>> {
        let mut out = Vec::new();
        for (axis, value) in members.iter().zip(values) {
            let axis = self.group.axes.get(*axis)?;
            let name = axis.name.clone();
            let Some((increments, lost)) = self.unit.increments(axis, *value) else {
                if self.unit.is_known(axis) {
                    let (lower, upper) = axis.travel;
                    let rule = format!(
                        "\"{name}\" may go from {} to {} from home",
                        self.unit.show(axis, lower.into()),
                        self.unit.show(axis, upper.into())
                    );
                    self.error(place, format!("{value:e}"), rule, "write a smaller number");
                    return None;
                }
                let rule = format!("\"{name}\" has no such position in the unit of the program");
                let help = "add units_per_turn to the axis in network.toml, or use another unit";
                self.error(place, value, rule, help);
                return None;
            };
            if relative && lost.abs() > 1e-6 {
                let rule = format!(
                    "for \"{name}\" this is {increments} increments and {lost:+.3}, which is lost \
                     each time"
                );
                let help = "use `to`, which counts from home, or a distance of whole increments";
                self.context.problems.warning(place, value, rule, help);
            }
            out.push(increments);
        }
        Some(out)
    }

    /// A position against the travel of an axis.
    pub(super) fn travel(&mut self, axis: usize, at: i64, place: &Place) -> Option<()> {
        let of = self.group.axes.get(axis)?;
        let (lower, upper) = (i64::from(of.travel.0), i64::from(of.travel.1));
        if (lower..=upper).contains(&at) {
            return Some(());
        }
        let rule = format!(
            "\"{}\" may go from {} to {} from home",
            of.name,
            self.unit.show(of, lower),
            self.unit.show(of, upper)
        );
        let nearest = self.unit.show(of, at.clamp(lower, upper));
        let shown = self.unit.show(of, at);
        let help = format!("the nearest that is allowed is {nearest}");
        self.error(place, shown, rule, &help);
        None
    }

    /// Whether an axis is known to be moved by torques here.
    pub(super) fn is_torque(&self, axis: usize) -> bool {
        let known = self.known.get(axis);
        known.is_some_and(|known| known.mode == Some(CYCLIC_TORQUE))
    }

    /// A torque in per mille of the rated one.
    pub(super) fn torque(&mut self, axis: usize, value: f64, place: &Place) -> Option<i32> {
        let name = self.group.axes.get(axis)?.name.clone();
        if value.abs() <= TORQUE_MAX as f64 {
            return Some(value as i32);
        }
        let rule =
            format!("the torque of \"{name}\" must be -{TORQUE_MAX} ..= {TORQUE_MAX} per mille");
        self.error(place, value, rule, "write less");
        None
    }

    /// Every piece of a path against the limits of its axes, as the firmware checks
    /// it: a cubic lies within the hull of its control points.
    pub(super) fn keeps(
        &mut self,
        path: &Path,
        what: &str,
        help: &str,
        place: &Place,
    ) -> Option<()> {
        for (number, member) in path.members.iter().enumerate() {
            let axis = self.group.axes.get(member.axis)?;
            let cycle = self.group.cycle_us;
            let (mut fastest, mut steepest) = (0.0f64, 0.0f64);
            let (mut low, mut high) = (0.0f64, 0.0f64);
            let (mut at, mut speed) = (0.0, 0.0);
            for point in &path.points {
                let time = f64::from(point.cycles);
                let (to, then) = path.at(number, point);
                let middle = 3.0 * (to - at) / time - speed - then;
                fastest = fastest.max(then.abs()).max(middle.abs());
                for change in [middle - speed, then - middle] {
                    steepest = steepest.max(2.0 * change.abs() / time);
                }
                for control in [at + speed * time / 3.0, to - then * time / 3.0, to] {
                    (low, high) = (low.min(control), high.max(control));
                }
                (at, speed) = (to, then);
            }
            let rpm = fastest / axis.per_rpm(cycle) * ROUNDING;
            let slope = steepest / axis.per_rpm_s(cycle) * ROUNDING;
            for (needed, most, unit, from) in [
                (rpm, axis.velocity_max, "rpm", "max_speed"),
                (slope, axis.acceleration_max, "rpm/s", "max_acceleration"),
            ] {
                if needed.trunc() > f64::from(most) {
                    let rule = format!(
                        "{what} needs {needed:.0} {unit} of \"{}\", which has {most} (its {from})",
                        axis.name
                    );
                    self.error(place, what, rule, help);
                    return None;
                }
            }
            let begin = match path.relative {
                true => self.known.get(member.axis).and_then(|known| known.at),
                false => Some(member.begin.into()),
            };
            // Where it begins anywhere, it at least has to fit at all.
            let (lower, upper) = axis.travel;
            let begin = begin.unwrap_or_else(|| {
                let least = i64::from(lower) - low.floor() as i64;
                least.min(i64::from(upper)).max(i64::from(lower))
            });
            for end in [low.round() as i64, high.round() as i64] {
                self.travel(member.axis, begin.saturating_add(end), place)?;
            }
        }
        Some(())
    }
}
