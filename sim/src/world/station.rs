//! The drives on the bus, each with its place there.

use canmaster::NodeId;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;

use super::{Scenario, network};
use crate::bus::{BitTiming, Bus, PortId};
use crate::drive::{Drive, DriveConfig};
use crate::time::Time;

/// Keeps the order in which drives from the factory are switched on apart from
/// everybody else's random numbers.
const FACTORY_STREAM: u64 = 0xFAC7_0000;
/// The last of them is switched on by then.
const SWITCHED_ON_US: u64 = 800_000;

/// A drive with its place on the bus.
pub(super) struct Station {
    pub(super) drive: Drive,
    pub(super) port: PortId,
    timing: Option<BitTiming>,
}

impl Station {
    pub(super) fn new(config: DriveConfig, port: PortId) -> Station {
        Station {
            drive: Drive::new(config),
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
pub(super) fn machine(scenario: &Scenario) -> Vec<Option<DriveConfig>> {
    let mut random = Pcg64Mcg::seed_from_u64(scenario.seed ^ FACTORY_STREAM);
    let mut drive = |node: NodeId| {
        let faults = scenario.faults.get(&node).into_iter().flatten().copied();
        let config = (scenario.tuned)(DriveConfig::new(node, scenario.seed));
        let mut config = faults.fold(config, DriveConfig::with);
        if scenario.factory {
            config.unconfigured = true;
            config.power_on = Time::from_us(random.random_range(0..=SWITCHED_ON_US));
        }
        config
    };
    let nodes = network().nodes.iter().map(|node| node.id);
    nodes
        .map(|node| (!scenario.without.contains(&node)).then(|| drive(node)))
        .collect()
}

/// A drive without node-ID that the network does not name.
pub(super) fn stranger(seed: u64) -> DriveConfig {
    let mut others = (1..=NodeId::MAX.get()).filter_map(NodeId::new);
    let node = others.find(|node| network().find(*node).is_none());
    DriveConfig {
        unconfigured: true,
        ..DriveConfig::new(node.unwrap_or(NodeId::MAX), seed)
    }
}
