//! The drives on the bus, each with its place there.

use canmaster::NodeId;
use canmaster::motion::experiment::Motor;
use canmaster::network::Node;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::{Machine, Scenario};
use crate::bus::{BitTiming, Bus, PortId};
use crate::drive::travel::Travel;
use crate::drive::{Drive, DriveConfig};
use crate::time::Time;

/// Keeps the order in which drives from the factory are switched on apart from
/// everybody else's random numbers.
const FACTORY_STREAM: u64 = 0xFAC7_0000;
/// The last of them is switched on by then.
const SWITCHED_ON_US: u64 = 800_000;

/// Its serial number follows from this; node-IDs are given from below.
const STRANGER: NodeId = NodeId::constant::<126>();

/// A drive with its place on the bus.
pub(super) struct Station {
    pub(super) drive: Drive,
    /// Which bus, and where on it.
    pub(super) line: usize,
    pub(super) port: PortId,
    timing: Option<BitTiming>,
}

impl Station {
    pub(super) fn new(config: DriveConfig, line: usize, port: PortId) -> Station {
        Station {
            drive: Drive::new(config),
            line,
            port,
            timing: None,
        }
    }

    /// Lets the drive do what is due, and tells the bus what it would send next.
    pub(super) fn advance(&mut self, bus: &mut Bus, now: Time) {
        if self.drive.next_deadline() <= now {
            self.drive.advance(now);
        }
        let timing = self.drive.timing();
        if timing != self.timing {
            self.timing = timing;
            bus.set_timing(self.port, timing, now);
        }
        bus.offer(self.port, self.drive.offer());
    }
}

/// The drives of the network, in its order; `None`: not on the bus.
pub(super) fn machine(machine: &Machine, scenario: &Scenario) -> Vec<Option<DriveConfig>> {
    let mut random = Pcg64Mcg::seed_from_u64(scenario.seed ^ FACTORY_STREAM);
    let mut drive = |axis: usize, node: &Node, motor: &Motor| {
        let faults = scenario.faults.get(&node.id).into_iter().flatten().copied();
        let bit_rate = machine.segments()[machine.segment_of(axis)].bit_rate;
        let described = described(node, motor, bit_rate, scenario.seed);
        let config = (scenario.tuned)(described);
        let mut config = faults.fold(config, DriveConfig::with);
        if scenario.factory {
            config.unconfigured = true;
            config.power_on = Time::from_us(random.random_range(0..=SWITCHED_ON_US));
        }
        config
    };
    let nodes = machine.network().nodes.iter().zip(machine.motors());
    nodes
        .enumerate()
        .map(|(axis, (node, motor))| {
            (!scenario.without.contains(&node.id)).then(|| drive(axis, node, motor))
        })
        .collect()
}

/// The drive as the network describes it: bit rate, identity, encoder.
fn described(node: &Node, motor: &Motor, bit_rate: u32, seed: u64) -> DriveConfig {
    let mut config = DriveConfig::new(node.id, seed);
    config.bit_rate = bit_rate;
    config.plant.increments_per_turn = motor.increments_per_turn;
    config.plant.travel = switches(node.id, motor.increments_per_turn);
    let (wanted, own) = (&node.identity, &mut config.identity);
    for (wanted, own) in [
        (wanted.device_type, &mut own.device_type),
        (wanted.vendor, &mut own.vendor),
        (wanted.product, &mut own.product),
        (wanted.revision, &mut own.revision),
        (node.serial, &mut own.serial),
    ] {
        *own = wanted.unwrap_or(*own);
    }
    config
}

/// A home switch some turns above where the axis stands, elsewhere for each, and an
/// index pulse a little below it.
fn switches(node: NodeId, increments_per_turn: u32) -> Travel {
    const FIRST: f64 = 1.5;
    const APART: f64 = 0.3;
    const LONG: f64 = 0.5;
    const INDEX: f64 = 0.2;
    let turn = f64::from(increments_per_turn);
    let from = turn * (FIRST + APART * f64::from(node.get() % 8));
    Travel {
        home_switch: Some((from, from + LONG * turn)),
        index_at: from - INDEX * turn,
        ..Travel::default()
    }
}

/// A drive without node-ID that no network is likely to name.
pub(super) fn stranger(seed: u64) -> DriveConfig {
    DriveConfig {
        unconfigured: true,
        ..DriveConfig::new(STRANGER, seed)
    }
}
