//! From a program as it is written to steps, everything checked on the way.

mod generators;
mod limits;
mod moves;

use toml::Spanned;

use super::axes::{self, CYCLIC_TORQUE, Group, HOMING, MODES, PROFILE_POSITION, mode_bit};
use super::description::{self, File, Values};
use super::units::{UNITS, Unit};
use super::{Action, LONGEST, LOOPS, Program, Step};
use crate::problem::{Place, Problems, nearest};
use crate::resolve::Context;
use crate::source::Source;

/// Longest time of a step, ms: a day.
const DAY_MS: f64 = 24.0 * 3600.0 * 1000.0;
/// A homing that takes longer is given up.
const HOMING_MS: f64 = 30_000.0;
/// What a step may be.
const KINDS: &str = "move, wait_ms, repeat, forever, sine, trapezoid, table, path, home or mode";

/// What is known of an axis where a step begins.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Known {
    /// Increments from home; `None`: that depends on what was before.
    at: Option<i64>,
    /// As 6060h.
    mode: Option<u8>,
}

struct Reader<'a> {
    group: &'a Group,
    file: &'a File,
    unit: Unit,
    known: Vec<Known>,
    context: Context<'a>,
}

/// The program that `source` describes, as far as it can be made.
pub(super) fn program(source: &Source, group: &Group, problems: &mut Problems) -> Option<Program> {
    let file: File = match toml::from_str(source.text()) {
        Ok(file) => file,
        Err(error) => {
            crate::description::malformed(source, &error, "docs/motion.md", problems);
            return None;
        }
    };
    let mut context = Context { source, problems };
    let unit = context.word(file.unit.as_ref(), "unit", &UNITS)?;
    let known = group.axes.iter().map(|axis| Known {
        at: None,
        mode: Some(axis.mode),
    });
    let mut reader = Reader {
        group,
        file: &file,
        unit,
        known: known.collect(),
        context,
    };
    if file.step.is_empty() {
        let place = Place::file(source);
        reader.context.problems.error(
            &place,
            "step",
            "the program has no step",
            format!("add [[step]] with {KINDS}"),
        );
    }
    let steps = reader.steps(&file.step, 0);
    let program = Program {
        name: file
            .name
            .clone()
            .unwrap_or_else(|| source.name().to_string()),
        axes: group.axes.len(),
        cycle_us: group.cycle_us,
        steps,
    };
    let length = program.bytes().len();
    if length > LONGEST {
        let place = Place::file(source);
        reader.context.problems.error(
            &place,
            format!("{length} bytes"),
            format!("a program has at most {LONGEST} bytes, and this one is longer"),
            "use fewer points in tables, and loops for what is repeated",
        );
    }
    Some(program)
}

impl Reader<'_> {
    fn error(&mut self, place: &Place, value: impl ToString, rule: String, help: &str) {
        self.context
            .problems
            .error(place, value.to_string(), rule, help);
    }

    fn steps(&mut self, steps: &[Spanned<description::Step>], depth: usize) -> Vec<Step> {
        let mut out = Vec::new();
        for step in steps {
            let place = self.context.at(step);
            let actions = self.step(step.get_ref(), &place, depth).unwrap_or_default();
            let line = place.line;
            out.extend(actions.into_iter().map(|action| Step { line, action }));
        }
        out
    }

    /// Usually one action.
    fn step(
        &mut self,
        step: &description::Step,
        place: &Place,
        depth: usize,
    ) -> Option<Vec<Action>> {
        let repeated = step.repeat.is_some() || step.forever.is_some();
        let kinds = [
            step.moves.is_some(),
            step.wait_ms.is_some(),
            repeated,
            step.sine.is_some(),
            step.trapezoid.is_some(),
            step.table.is_some(),
            step.path.is_some(),
            step.home.is_some(),
            step.mode.is_some(),
        ];
        let given = kinds.iter().filter(|is| **is).count();
        if given != 1 {
            let rule = match given {
                0 => "a step without anything to do".to_string(),
                _ => "a step does one thing".to_string(),
            };
            self.error(place, "[[step]]", rule, &format!("write one of {KINDS}"));
            return None;
        }
        if !repeated && !step.step.is_empty() {
            let rule = "steps within a step are repeated".to_string();
            self.error(place, "[[step]]", rule, "add repeat = 2, or forever = true");
            return None;
        }
        if let Some(jerk) = step.jerk.as_ref().filter(|_| step.moves.is_none()) {
            let place = self.context.at(jerk);
            let rule = "only a move has a jerk".to_string();
            self.error(&place, jerk.get_ref(), rule, "remove it");
        }
        let flying = step.settle.as_ref().is_some_and(|settle| !settle.get_ref());
        if let Some(moves) = &step.moves {
            let a_move = self.moves(moves, step.jerk.as_ref(), place)?;
            return Some(vec![Action::Move(super::Move { flying, ..a_move })]);
        }
        if let Some(wait) = &step.wait_ms {
            let ms = self.milliseconds(wait, "wait_ms", 0.0)?;
            let cycles = self.group.cycles(ms);
            return Some(vec![Action::Wait { cycles }]);
        }
        if repeated {
            return self.repeat(step, place, depth);
        }
        if let Some(home) = &step.home {
            return self.home(home);
        }
        if let Some(mode) = &step.mode {
            return self.mode(mode.get_ref());
        }
        let path = self.path(step)?;
        Some(vec![Action::Path(super::Path { flying, ..path })])
    }

    fn repeat(
        &mut self,
        step: &description::Step,
        place: &Place,
        depth: usize,
    ) -> Option<Vec<Action>> {
        if depth == LOOPS {
            let rule = format!("steps are repeated within {LOOPS} others at most");
            self.error(place, "[[step]]", rule, "write the innermost several times");
            return None;
        }
        let times = match (&step.repeat, &step.forever) {
            (Some(repeat), None) => self.context.number(repeat, "repeat", 1..=u16::MAX.into())?,
            (None, Some(forever)) if *forever.get_ref() => 0,
            _ => {
                let rule = "repeat says how often, and forever = true that it does not end";
                let help = "write one of the two";
                self.error(place, "[[step]]", rule.to_string(), help);
                return None;
            }
        };
        if step.step.is_empty() {
            let rule = "there is nothing to repeat".to_string();
            self.error(place, "[[step]]", rule, "add steps: [[step.step]]");
            return None;
        }
        if times != 1 {
            // What holds the first time, but not after the last step, is not known.
            let before = self.known.clone();
            let mut unsaid = Problems::default();
            let mut rehearsal = Reader {
                group: self.group,
                file: self.file,
                unit: self.unit,
                known: before.clone(),
                context: Context {
                    source: self.context.source,
                    problems: &mut unsaid,
                },
            };
            rehearsal.steps(&step.step, depth + 1);
            for (now, then) in self.known.iter_mut().zip(rehearsal.known) {
                now.at = now.at.filter(|_| now.at == then.at);
                now.mode = now.mode.filter(|_| now.mode == then.mode);
            }
        }
        let steps = self.steps(&step.step, depth + 1);
        Some(vec![Action::Repeat { times, steps }])
    }

    /// A time that is at least `least`, which 0 excludes.
    fn milliseconds(&mut self, time: &Spanned<f64>, key: &str, least: f64) -> Option<f64> {
        let ms = *time.get_ref();
        if ms > 0.0 && ms >= least && ms <= DAY_MS {
            return Some(ms);
        }
        let place = self.context.at(time);
        let rule = format!("{key} must be above {least} and at most {DAY_MS}");
        self.error(&place, ms, rule, "write a time in milliseconds");
        None
    }

    /// The axes of a step, in their order among the members: all, if it names none.
    fn members(&mut self, names: Option<&Spanned<Vec<Spanned<String>>>>) -> Option<Vec<usize>> {
        let Some(names) = names else {
            return Some((0..self.group.axes.len()).collect());
        };
        let mut members = Vec::new();
        for name in names.get_ref() {
            let place = self.context.at(name);
            let wanted = name.get_ref();
            let known = || self.group.axes.iter().map(|axis| axis.name.as_str());
            let Some(axis) = known().position(|known| known == wanted) else {
                let help = match nearest(wanted, known()) {
                    Some(name) => format!("did you mean \"{name}\"?"),
                    None => format!("the axes are {}", known().collect::<Vec<_>>().join(", ")),
                };
                let rule = "the machine has no axis of this name".to_string();
                self.error(&place, wanted, rule, &help);
                return None;
            };
            if members.contains(&axis) {
                let rule = "an axis is named twice".to_string();
                self.error(&place, wanted, rule, "remove one of the two");
                return None;
            }
            members.push(axis);
        }
        if members.is_empty() {
            let place = self.context.at(names);
            let rule = "there is no axis".to_string();
            self.error(&place, "[]", rule, "name some, or leave axes out for all");
            return None;
        }
        Some(members)
    }

    /// A number for each member.
    fn values(&mut self, values: &Spanned<Values>, key: &str, members: usize) -> Option<Vec<f64>> {
        let place = self.context.at(values);
        if let Values::Each(all) = values.get_ref()
            && all.len() != members
        {
            let rule = format!("{key} has {} numbers for {members} axes", all.len());
            let help = "write one number for all, or one for each";
            self.error(&place, values.get_ref(), rule, help);
            return None;
        }
        let all: Vec<f64> = (0..members)
            .map(|member| values.get_ref().of(member))
            .collect();
        if let Some(value) = all.iter().find(|value| !value.is_finite()) {
            self.error(
                &place,
                value,
                format!("{key} is no number"),
                "write a number",
            );
            return None;
        }
        Some(all)
    }

    fn home(&mut self, home: &Spanned<description::Home>) -> Option<Vec<Action>> {
        let members = self.members(home.get_ref().axes.as_ref())?;
        let ms = match &home.get_ref().limit_ms {
            Some(limit) => self.milliseconds(limit, "limit_ms", 0.0)?,
            None => HOMING_MS,
        };
        let place = self.context.at(home);
        self.can(&members, HOMING, &place)?;
        let set = |axes: &[usize]| axes.iter().fold(0, |set, axis| set | 1u32 << axis);
        let axes = set(&members);
        let mut actions = vec![
            Action::Mode { axes, mode: HOMING },
            Action::Home {
                axes,
                limit: self.group.cycles(ms),
            },
        ];
        // Back to what each was in; where that is not known, to what it begins in.
        let before = |reader: &Reader<'_>, axis: usize| {
            let known = reader.known.get(axis).and_then(|known| known.mode);
            known.or_else(|| Some(reader.group.axes.get(axis)?.mode))
        };
        for (_, mode) in MODES {
            let back = members.iter().copied();
            let back: Vec<usize> = back
                .filter(|axis| before(self, *axis) == Some(mode))
                .collect();
            if !back.is_empty() {
                let axes = set(&back);
                actions.push(Action::Mode { axes, mode });
            }
        }
        for axis in members {
            let mode = before(self, axis);
            self.known[axis] = Known { at: None, mode };
        }
        Some(actions)
    }

    fn mode(&mut self, mode: &description::Mode) -> Option<Vec<Action>> {
        let members = self.members(mode.axes.as_ref())?;
        let code = self.context.word(Some(&mode.is), "the mode", &MODES)?;
        let place = self.context.at(&mode.is);
        if code == HOMING {
            let rule = "an axis is in homing mode only while it searches for its home";
            let help = "write [step.home], which changes the mode and back";
            self.error(&place, mode.is.get_ref(), rule.to_string(), help);
            return None;
        }
        self.can(&members, code, &place)?;
        let mut axes = 0;
        for axis in members {
            axes |= 1 << axis;
            let torque = [self.known[axis].mode, Some(code)].contains(&Some(CYCLIC_TORQUE));
            self.known[axis].mode = Some(code);
            // A torque is no position, and leads anywhere.
            if torque {
                self.known[axis].at = None;
            }
        }
        Some(vec![Action::Mode { axes, mode: code }])
    }

    /// Whether the axes have a mode.
    fn can(&mut self, members: &[usize], mode: u8, place: &Place) -> Option<()> {
        for axis in members {
            let axis = self.group.axes.get(*axis)?;
            if axis.modes & mode_bit(mode) == 0 {
                let has = MODES
                    .iter()
                    .filter(|(_, code)| axis.modes & mode_bit(*code) != 0);
                let has: Vec<&str> = has.map(|(name, _)| *name).collect();
                let rule = format!(
                    "\"{}\" cannot be led in this mode: its drive lacks it (6502h), or no RPDO \
                     carries its target",
                    axis.name
                );
                let help = format!("it has {}", has.join(", "));
                self.error(place, axes::mode_name(mode), rule, &help);
                return None;
            }
        }
        Some(())
    }

    /// The mode that each of the axes is in is known to follow a path.
    fn follows_paths(&mut self, members: &[usize], place: &Place) -> Option<()> {
        for axis in members {
            let mode = self.known.get(*axis).and_then(|known| known.mode);
            if let Some(mode @ (PROFILE_POSITION | CYCLIC_TORQUE)) = mode {
                let name = &self.group.axes.get(*axis)?.name;
                let rule = format!(
                    "\"{name}\" is in mode \"{}\" here, and follows no path",
                    axes::mode_name(mode)
                );
                let help = "change to a velocity mode or cyclic synchronous position before";
                self.error(place, name.clone(), rule, help);
                return None;
            }
        }
        Some(())
    }
}
