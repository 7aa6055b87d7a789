//! Sines, trapezoids, tables and way-points.

use toml::Spanned;

use super::Reader;
use crate::problem::Place;
use crate::program::description::{self, Sine, Table, Trapezoid, Values, WayPoints};
use crate::program::shape::{self, AMPLITUDE_MAX, Begin};
use crate::program::{LONGEST, Path};

/// Fewer points are no sine.
const POINTS_MIN: i64 = 4;
/// More points than that do not fit into a program.
const ROWS_MAX: usize = LONGEST / 8;
/// A phase is one piece.
const CYCLES_MAX: u32 = u16::MAX as u32;

impl Reader<'_> {
    pub(super) fn path(&mut self, step: &description::Step) -> Option<Path> {
        if let Some(sine) = &step.sine {
            return self.sine(sine);
        }
        if let Some(trapezoid) = &step.trapezoid {
            return self.trapezoid(trapezoid);
        }
        if let Some(table) = &step.table {
            return self.table(table);
        }
        self.way_points(step.path.as_ref()?)
    }

    fn periods(&mut self, periods: Option<&Spanned<i64>>) -> Option<u16> {
        match periods {
            Some(periods) => self.context.number(periods, "periods", 1..=u16::MAX.into()),
            None => Some(1),
        }
    }

    /// How far each of the axes goes; `times`: so many amplitudes.
    fn begins(&mut self, members: &[usize], amplitude: &Spanned<Values>) -> Option<Vec<Begin>> {
        let place = self.context.at(amplitude);
        let values = self.values(amplitude, "amplitude", members.len())?;
        let increments = self.increments(&values, members, &place, false)?;
        let mut begins = Vec::new();
        for (axis, amplitude) in members.iter().copied().zip(increments) {
            if amplitude.abs() > AMPLITUDE_MAX {
                let rule = format!("an amplitude has at most {AMPLITUDE_MAX} increments");
                self.error(&place, amplitude, rule, "write a smaller one");
                return None;
            }
            begins.push(Begin { axis, amplitude });
        }
        Some(begins)
    }

    fn sine(&mut self, described: &Spanned<Sine>) -> Option<Path> {
        let place = self.context.at(described);
        let sine = described.get_ref();
        let members = self.members(sine.axes.as_ref())?;
        self.follows_paths(&members, &place)?;
        let begins = self.begins(&members, &sine.amplitude)?;
        let most = i64::from(u16::MAX);
        let points: u32 = self
            .context
            .number(&sine.points, "points", POINTS_MIN..=most)?;
        let cycles: u32 = match &sine.cycles {
            Some(cycles) => self.context.number(cycles, "cycles", 1..=most)?,
            None => 1,
        };
        let Some(period) = points.checked_mul(cycles).filter(|all| *all < 1 << 22) else {
            let rule = "a period is shorter than 4,194,304 cycles".to_string();
            self.error(
                &place,
                points,
                rule,
                "use fewer points, or fewer cycles of a point",
            );
            return None;
        };
        let periods = self.periods(sine.periods.as_ref())?;
        let path = shape::sine(&begins, period, periods);
        let help = "make the amplitude smaller, or the period longer: points, cycles";
        self.keeps(&path, "this sine", help, &place)?;
        Some(path)
    }

    fn trapezoid(&mut self, described: &Spanned<Trapezoid>) -> Option<Path> {
        let place = self.context.at(described);
        let trapezoid = described.get_ref();
        let members = self.members(trapezoid.axes.as_ref())?;
        self.follows_paths(&members, &place)?;
        let begins = self.begins(&members, &trapezoid.amplitude)?;
        let mut phases = [0; 3];
        let times = [
            (Some(&trapezoid.ramp_ms), "ramp_ms"),
            (trapezoid.speed_ms.as_ref(), "speed_ms"),
            (trapezoid.rest_ms.as_ref(), "rest_ms"),
        ];
        for (phase, (time, key)) in phases.iter_mut().zip(times) {
            *phase = match time {
                Some(time) => self.piece(time, key)?,
                None => 0,
            };
        }
        let periods = self.periods(trapezoid.periods.as_ref())?;
        let path = shape::trapezoid(&begins, phases, periods);
        let help = "make the amplitude smaller, or the times longer";
        self.keeps(&path, "this trapezoid", help, &place)?;
        Some(path)
    }

    /// Cycles of one piece.
    fn piece(&mut self, time: &Spanned<f64>, key: &str) -> Option<u32> {
        let ms = self.milliseconds(time, key, 0.0)?;
        let cycles = self.group.cycles(ms);
        if cycles <= CYCLES_MAX {
            return Some(cycles);
        }
        let place = self.context.at(time);
        let rule = format!("{key} has at most {CYCLES_MAX} cycles");
        self.error(&place, ms, rule, "write a shorter time");
        None
    }

    /// Points of all members in increments.
    fn rows(
        &mut self,
        points: &Spanned<Vec<Spanned<Values>>>,
        members: &[usize],
    ) -> Option<Vec<Vec<i64>>> {
        let all = points.get_ref();
        if all.is_empty() || all.len() > ROWS_MAX {
            let place = self.context.at(points);
            let rule = format!("there are 1 ..= {ROWS_MAX} points");
            self.error(
                &place,
                all.len(),
                rule,
                "write some, or divide them between programs",
            );
            return None;
        }
        let mut rows = Vec::new();
        for row in all {
            let place = self.context.at(row);
            let values = self.values(row, "a point", members.len())?;
            rows.push(self.increments(&values, members, &place, false)?);
        }
        Some(rows)
    }

    /// A path whose members have shapes of their own.
    fn own(
        &mut self,
        members: &[usize],
        begins: &[i32],
        knots: &[shape::Knot],
        place: &Place,
    ) -> Option<Path> {
        let path = shape::own(members, begins, knots);
        if path.is_none() {
            let rule = format!("a point lies at most {AMPLITUDE_MAX} increments from the begin");
            self.error(
                place,
                "points",
                rule,
                "divide the way between several steps",
            );
        }
        path
    }

    fn table(&mut self, described: &Spanned<Table>) -> Option<Path> {
        let place = self.context.at(described);
        let table = described.get_ref();
        let members = self.members(table.axes.as_ref())?;
        self.follows_paths(&members, &place)?;
        let cycles = self.piece(&table.every_ms, "every_ms")?;
        let rows = self.rows(&table.points, &members)?;
        let periods = self.periods(table.periods.as_ref())?;
        let last = rows.last()?;
        if periods > 1 && last.iter().any(|at| *at != 0) {
            let place = self.context.at(table.points.get_ref().last()?);
            let rule = "a table that is repeated ends where it begins".to_string();
            let help = "write 0 for each axis as last point, or use repeat";
            self.error(&place, format!("{last:?}"), rule, help);
            return None;
        }
        let knots = shape::table(&rows, cycles);
        let begins = vec![0; members.len()];
        let path = Path {
            relative: true,
            periods,
            ..self.own(&members, &begins, &knots, &place)?
        };
        let help = "put the points nearer to one another, or make every_ms longer";
        self.keeps(&path, "this table", help, &place)?;
        for (axis, way) in members.iter().zip(last) {
            let known = self.known.get_mut(*axis)?;
            known.at = known.at.map(|at| at.saturating_add(*way));
        }
        Some(path)
    }

    fn way_points(&mut self, described: &Spanned<WayPoints>) -> Option<Path> {
        let place = self.context.at(described);
        let described = described.get_ref();
        let members = self.members(described.axes.as_ref())?;
        self.follows_paths(&members, &place)?;
        let mut begins = Vec::new();
        for axis in &members {
            let Some(at) = self.known.get(*axis).and_then(|known| known.at) else {
                let name = self.group.axes.get(*axis)?.name.clone();
                let rule = "where the path begins for this axis is not known here".to_string();
                let help = "move it `to` a position in a step before";
                self.error(&place, name, rule, help);
                return None;
            };
            begins.push(i32::try_from(at).ok()?);
        }
        let file = self.file;
        let (own, of_file) = (described.velocity.as_ref(), file.velocity.as_ref());
        let velocity = self.ramps(own, of_file, "velocity", &members, &place)?;
        let (own, of_file) = (described.acceleration.as_ref(), file.acceleration.as_ref());
        let acceleration = self.ramps(own, of_file, "acceleration", &members, &place)?;
        let mut rows = self.rows(&described.points, &members)?;
        for (row, written) in rows.iter_mut().zip(described.points.get_ref()) {
            let place = self.context.at(written);
            for ((axis, begin), at) in members.iter().zip(&begins).zip(row) {
                self.travel(*axis, *at, &place)?;
                *at -= i64::from(*begin);
            }
        }
        let cycle = self.group.cycle_us;
        let ramps = velocity.iter().zip(&acceleration);
        let limits = members.iter().zip(ramps).filter_map(|(axis, (v, a))| {
            let axis = self.group.axes.get(*axis)?;
            let velocity = f64::from(*v) * axis.per_rpm(cycle);
            Some((velocity, f64::from(*a) * axis.per_rpm_s(cycle)))
        });
        let knots = shape::way_points(&rows, &limits.collect::<Vec<_>>());
        let path = self.own(&members, &begins, &knots, &place)?;
        self.keeps(&path, "this path", "make it slower", &place)?;
        for ((axis, begin), way) in members.iter().zip(&begins).zip(rows.last()?) {
            self.known.get_mut(*axis)?.at = Some(i64::from(*begin) + way);
        }
        Some(path)
    }
}
