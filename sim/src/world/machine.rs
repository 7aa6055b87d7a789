//! The machine that the firmware is built for, and what it does, in the judge's
//! terms.

use std::path::Path;
use std::sync::LazyLock;

use canmaster::motion::experiment::Motor;
use canmaster::network::Network;
use canmaster::network::sample::SIX_EPOS4;
use canmaster_network::Source;
use canmaster_network::layout::{Cyclic, RpdoOrder};
use canmaster_network::model;
use canmaster_network::program::{self, Axis, Group, Program};

use super::library::{self, LibraryError};
use crate::judge::realtime::Bursts;
use crate::judge::{Assignment, Part, Traffic};
use crate::time::Time;

/// Why there is no such machine.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MachineError {
    /// The description is refused.
    #[error("{0}")]
    Refused(String),
    /// There is nothing to be moved.
    #[error("a machine of {0} axes cannot be simulated: describe 1 .. 16 nodes")]
    Axes(usize),
    /// One SYNC tick drives all buses.
    #[error("the buses have different cycles: give all of them the same cycle_us")]
    Cycles,
    /// The description was not checked.
    #[error(transparent)]
    Library(#[from] LibraryError),
}

/// One bus of a machine.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Segment {
    /// Its name.
    pub name: String,
    /// Which of the board's controllers drives it: 0 is FDCAN1.
    pub controller: usize,
    /// bit/s
    pub bit_rate: u32,
    /// The axes whose drives are on it, by their place in the network.
    pub axes: Vec<usize>,
    /// The RPDOs that the master has ready together.
    pub bursts: Bursts,
}

/// Network, buses, motors, and the moves that one release makes.
#[derive(Clone, Debug)]
pub struct Machine {
    network: &'static Network,
    segments: Vec<Segment>,
    motors: Vec<Motor>,
    moves: Vec<Vec<Option<Part>>>,
    round_trip: Option<Time>,
    least: Time,
    torque: bool,
}

/// The sample: six EPOS4.
pub fn sample() -> &'static Machine {
    static SAMPLE: LazyLock<Machine> = LazyLock::new(|| {
        let motors = vec![Motor::SAMPLE; SIX_EPOS4.nodes.len()];
        let group = group(&SIX_EPOS4, &motors);
        let Moves {
            moves,
            round_trip,
            least,
            torque,
        } = course(&program::pairs(&group), &group);
        Machine {
            network: &SIX_EPOS4,
            segments: vec![sample_segment()],
            motors,
            moves,
            round_trip,
            least,
            torque,
        }
    });
    &SAMPLE
}

impl Machine {
    /// The machine that the file at `path` describes.
    ///
    /// # Errors
    /// What is wrong with the description, for a person.
    pub fn read(path: &Path) -> Result<Machine, MachineError> {
        let outcome = canmaster_network::load(path);
        let Some(machine) = outcome.machine else {
            let problems: Vec<String> = outcome.problems.iter().map(ToString::to_string).collect();
            return Err(MachineError::Refused(problems.join("\n\n")));
        };
        Machine::new(&machine)
    }

    /// The machine of a description. It stays in memory until the program ends.
    ///
    /// # Errors
    /// If it has no axes, or too many.
    pub fn new(described: &model::Machine) -> Result<Machine, MachineError> {
        let motors: Vec<Motor> = described.nodes.iter().filter_map(motor).collect();
        let none = || MachineError::Axes(described.nodes.len());
        let cycle = described.buses.first().map(|bus| bus.cycle_us);
        if described
            .buses
            .iter()
            .any(|bus| Some(bus.cycle_us) != cycle)
        {
            return Err(MachineError::Cycles);
        }
        let network = library::network(described)?;
        let group = Group::of(described).filter(|group| !group.axes.is_empty());
        let group = group.filter(|group| group.axes.len() <= AXES_MAX);
        let (Some(group), Some(program)) = (group, &described.program) else {
            return Err(none());
        };
        let Moves {
            moves,
            round_trip,
            least,
            torque,
        } = course(program, &group);
        Ok(Machine {
            network,
            segments: segments(described),
            motors,
            moves,
            round_trip,
            least,
            torque,
        })
    }

    /// The network.
    pub fn network(&self) -> &'static Network {
        self.network
    }

    /// The buses, in the order of the description; there is at least one.
    pub fn segments(&self) -> &[Segment] {
        &self.segments
    }

    /// The place of the bus that the drive of an axis is on.
    pub fn segment_of(&self, axis: usize) -> usize {
        let on = |segment: &Segment| segment.axes.contains(&axis);
        self.segments.iter().position(on).unwrap_or(0)
    }

    /// The motors, in the order of the axes.
    pub fn motors(&self) -> &[Motor] {
        &self.motors
    }

    /// The moves that one release makes.
    pub fn assignment(&self) -> Assignment {
        Assignment {
            moves: self.moves.clone(),
            cycle: Time::from(self.network.cycle),
            least: self.least,
            torque: self.torque,
        }
    }

    /// How long the program says that one round trip takes.
    pub fn round_trip(&self) -> Option<Time> {
        self.round_trip
    }

    /// The bytes of a program in TOML for this machine, whose axes are in profile
    /// velocity mode when it begins.
    ///
    /// # Errors
    /// What is wrong with it, for a person.
    pub fn program(&self, name: &str, text: &str) -> Result<Vec<u8>, String> {
        let source = Source::new(name, text.as_bytes());
        let outcome = program::read_for(&source, &group(self.network, &self.motors));
        let problems = || outcome.problems.iter().map(ToString::to_string);
        let program = outcome.program.as_ref();
        let bytes = program.map(Program::bytes);
        bytes.ok_or_else(|| problems().collect::<Vec<String>>().join("\n"))
    }

    /// What has to be on a bus in every cycle.
    pub fn traffic(&self, segment: &Segment) -> Traffic {
        let node = |axis: &usize| self.network.nodes.get(*axis).map(|node| node.id);
        Traffic {
            bit_rate: segment.bit_rate,
            cycle: Time::from(self.network.cycle),
            nodes: segment.axes.iter().filter_map(node).collect(),
        }
    }
}

/// Axes that the firmware leads at most.
const AXES_MAX: usize = 16;

/// No run is so long that a program is repeated so often.
const NEVER: usize = 1000;

/// What a program asks for.
struct Moves {
    /// Where each axis has to come to rest.
    moves: Vec<Vec<Option<Part>>>,
    /// How long that takes.
    round_trip: Option<Time>,
    /// It is not over before, however the axes stand meanwhile.
    least: Time,
    /// Axes are driven by torque.
    torque: bool,
}

/// What a program asks for, as the description has it and nobody else.
fn course(program: &Program, group: &Group) -> Moves {
    let course = program.course(group);
    let part = |stop: Option<program::Stop>| {
        stop.map(|stop| Part {
            target: stop.target,
            origin: stop.origin,
            set: stop.set,
            sure: stop.sure,
            within: stop.within,
        })
    };
    // One that does not end is never seen to have ended: by torque it has to say so, and
    // is left elsewhere each time.
    let again = course.endless && !course.torque;
    let times = if again { NEVER } else { 1 };
    let rests = std::iter::repeat_n(course.rests, times).flatten();
    let moves = rests.map(|rest| rest.into_iter().map(part).collect());
    let time = |cycles: u64| Time::from_us(cycles * u64::from(group.cycle_us));
    Moves {
        moves: moves.collect(),
        round_trip: (!course.endless).then_some(time(course.cycles)),
        least: time(course.least),
        torque: course.torque,
    }
}

/// The axes of a network as programs know them.
fn group(network: &Network, motors: &[Motor]) -> Group {
    let axes = network.nodes.iter().zip(motors);
    let axes = axes.map(|(node, motor)| Axis::new(node.name.to_string(), described(motor)));
    Group::new(axes.collect(), network.cycle.as_micros())
}

/// A motor as the description has it.
const fn described(motor: &Motor) -> model::Motor {
    model::Motor::new(
        motor.increments_per_turn,
        motor.gear,
        motor.max_speed,
        motor.max_acceleration,
        motor.limits,
        motor.modes,
    )
}

fn motor(node: &model::Node) -> Option<Motor> {
    let motor = node.motor()?;
    Some(Motor {
        increments_per_turn: motor.increments_per_turn,
        gear: motor.gear,
        max_speed: motor.max_speed,
        max_acceleration: motor.max_acceleration,
        limits: motor.limits,
        modes: motor.modes,
    })
}

/// The buses of a description.
fn segments(described: &model::Machine) -> Vec<Segment> {
    let buses = described.buses.iter().enumerate();
    buses
        .map(|(place, bus)| {
            let nodes = described.nodes.iter().enumerate();
            let on_it = nodes.filter(|(_, node)| node.bus == place);
            Segment {
                name: bus.name.clone(),
                controller: usize::from(bus.peripheral.saturating_sub(1)),
                bit_rate: bus.bit_rate,
                axes: on_it.map(|(axis, _)| axis).collect(),
                bursts: bursts(described, bus),
            }
        })
        .collect()
}

/// What the layout says is ready together.
fn bursts(described: &model::Machine, bus: &model::Bus) -> Bursts {
    let ids = |frames: &[Cyclic]| -> Vec<u16> { frames.iter().map(|(id, ..)| *id).collect() };
    let demand = &bus.layout.demand;
    let mut bursts = Bursts {
        after_sync: ids(&demand.ramps),
        after_tpdos: Vec::new(),
    };
    match demand.order {
        RpdoOrder::AfterSync => bursts.after_sync.extend(ids(&demand.rpdos)),
        RpdoOrder::AfterTpdos => bursts.after_tpdos.extend(ids(&demand.rpdos)),
    }
    // A planned frame goes when its slot is: directly after SYNC, if no RPDO of every
    // cycle goes there. Without a slot it goes when it is made.
    let anywhere = |bus: &model::Bus| {
        let demand = &bus.layout.demand;
        demand.order == RpdoOrder::AfterSync || !demand.ramps.is_empty()
    };
    let slot_is_after_sync = !described.buses.iter().any(anywhere);
    match (demand.is_planned(), slot_is_after_sync) {
        (true, true) => bursts.after_sync.extend(ids(&demand.on_change)),
        (true, false) => (),
        (false, _) => bursts.after_tpdos.extend(ids(&demand.on_change)),
    }
    bursts
}

/// The sample's only bus.
fn sample_segment() -> Segment {
    Segment {
        name: "main".to_string(),
        controller: 0,
        bit_rate: SIX_EPOS4.bit_rate,
        axes: (0..SIX_EPOS4.nodes.len()).collect(),
        bursts: Bursts::default(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten turns of 2000 increments.
    const TEN_TURNS: u32 = 20_000;

    #[test]
    fn every_axis_goes_at_least_ten_turns_away_and_comes_back() {
        let assignment = sample().assignment();
        assert_eq!(assignment.moves.len(), 2);
        for (there, back) in assignment.moves[0].iter().zip(&assignment.moves[1]) {
            assert!(there.unwrap().target.unsigned_abs() >= TEN_TURNS);
            assert_eq!(back.unwrap().target, 0);
        }
    }

    #[test]
    fn axes_go_in_pairs_and_an_odd_one_alone() {
        for (axes, sets) in [
            (1, &[1][..]),
            (2, &[1, 1]),
            (3, &[1, 2, 1]),
            (4, &[1, 2, 1, 2]),
            (5, &[1, 2, 1, 2, 3]),
            (6, &[1, 2, 1, 2, 3, 3]),
            (7, &[1, 2, 1, 2, 3, 3, 4]),
            (8, &[1, 2, 1, 2, 3, 3, 4, 4]),
            (12, &[1, 2, 1, 2, 3, 3, 4, 5, 4, 5, 6, 6]),
        ] {
            let Moves {
                moves, round_trip, ..
            } = pairs(&vec![Motor::SAMPLE; axes]);
            assert!(round_trip.is_some());
            for parts in moves {
                let found: Vec<u8> = parts.iter().map(|part| part.unwrap().set).collect();
                assert_eq!(found, sets);
            }
        }
    }

    /// What motors do in cycles of 10 ms.
    fn pairs(motors: &[Motor]) -> Moves {
        const CYCLE_US: u32 = 10_000;
        let axis = |motor: &Motor| Axis::new("axis".to_string(), described(motor));
        let group = Group::new(motors.iter().map(axis).collect(), CYCLE_US);
        course(&program::pairs(&group), &group)
    }

    #[test]
    fn the_program_keeps_within_the_limits_of_the_axis() {
        let targets = |motor: Motor| -> Vec<i32> {
            let Moves {
                moves, round_trip, ..
            } = pairs(&[motor; 6]);
            assert!(round_trip.is_some());
            moves[0].iter().map(|part| part.unwrap().target).collect()
        };
        let limited = |limits| {
            targets(Motor {
                limits,
                ..Motor::SAMPLE
            })
        };
        let far = [40_000, -32_000, 40_000, -32_000, 60_000, 60_000];
        assert_eq!(limited((-i32::MAX, i32::MAX)), far);
        // A quarter turn of 2000 before the limit.
        assert_eq!(
            limited((-10_500, 50_500)),
            [40_000, 32_000, 40_000, 32_000, 50_000, 50_000]
        );
        assert_eq!(
            limited((-100_000, 0)),
            [-40_000, -32_000, -40_000, -32_000, -60_000, -60_000]
        );
        let geared = targets(Motor {
            gear: (3, 2),
            ..Motor::SAMPLE
        });
        assert_eq!(geared, far.map(|target| target / 2 * 3));
    }

    #[test]
    fn the_description_of_the_project_is_the_sample() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../network.toml");
        let mut read = Machine::read(&path).unwrap();
        // The sample has no layout.
        for segment in &mut read.segments {
            segment.bursts = Bursts::default();
        }
        assert_eq!(format!("{read:?}"), format!("{:?}", sample()));
    }

    #[test]
    fn what_is_refused_says_why() {
        let refused = Machine::read(Path::new("nowhere.toml")).unwrap_err();
        assert!(refused.to_string().contains("nowhere.toml"));
    }
}
