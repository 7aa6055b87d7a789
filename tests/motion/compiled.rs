//! Programs as they are written, compiled for the six axes of the rig.

use canmaster::motion::AxisMove;
use canmaster::motion::experiment::Motor;
use canmaster_network::program::{self, Action, Axis, Group, Program};
use canmaster_network::{Source, model};

use crate::rig::{AXES, CYCLE_MS};

pub(crate) fn group() -> Group {
    let Motor {
        increments_per_turn,
        gear,
        max_speed,
        max_acceleration,
        limits,
        modes,
    } = Motor::SAMPLE;
    let motor = model::Motor::new(
        increments_per_turn,
        gear,
        max_speed,
        max_acceleration,
        limits,
        modes,
    );
    let axes = (1..=AXES).map(|n| Axis::new(format!("axis {n}"), motor));
    Group::new(axes.collect(), (CYCLE_MS * 1000.0) as u32)
}

pub(crate) fn compiled(text: &str) -> Program {
    let outcome = program::read_for(&Source::new("p.toml", text.as_bytes()), &group());
    let problems: Vec<String> = outcome.problems.iter().map(ToString::to_string).collect();
    outcome
        .program
        .unwrap_or_else(|| panic!("{}", problems.join("\n")))
}

/// The moves of the experiment.
pub(crate) fn pairs() -> Vec<[AxisMove; AXES]> {
    let moves = program::pairs(&group()).steps.into_iter();
    let moves = moves.filter_map(|step| match step.action {
        Action::Move(a_move) => Some(core::array::from_fn(|n| AxisMove {
            target: a_move.parts[n].target,
            velocity: a_move.parts[n].velocity,
            acceleration: a_move.parts[n].acceleration,
            deceleration: a_move.parts[n].deceleration,
            set: a_move.parts[n].set,
        })),
        _ => None,
    });
    moves.collect()
}
