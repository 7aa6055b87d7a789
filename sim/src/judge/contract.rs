//! The contract for faults as times: what goes wrong, when it is known at the
//! latest, who stops what, and when everything stands.
//!
//! After detection the second SYNC at the latest carries the stop. What the master
//! stops comes to rest together, on ramps that it makes; a drive that stops by
//! itself takes its quick-stop ramp (6085h); one that its own error, STO or the loss
//! of its supply has disabled coasts.

use canmaster::motion::mode::Mode;
use canmaster::network::Network;

use crate::time::Time;

/// After detection, the SYNC that carries the stop.
const STOP_SYNC: u64 = 2;
/// From a SYNC to its TPDOs, and the drives' control cycle: within one period.
const ONE_CYCLE: u64 = 1;
/// The fastest that an axis is commanded in what the campaign strikes, rpm.
const FASTEST_RPM: u64 = 2200;
/// Deceleration of the fastest axis in a stop by the master, rpm/s.
pub(super) const STOP_RPM_PER_S: u64 = 3000;
/// 6085h, rpm/s.
const QUICK_STOP_RPM_PER_S: u64 = 10_000;
/// From the end of a ramp until the shaft is below the speed that counts as
/// standing: the tail of a velocity loop of 10 ms.
const TAIL: Time = Time::from_ms(100);
/// An axis without torque comes to rest by friction: at least 2 % of rated torque
/// against 1.3 times the inertia, of which a disturbance may take away a part for
/// a while.
const COASTS: Time = Time::from_ms(7000);
/// Drives that a bus-off has stopped have to find out: 32 frames in error.
const BUS_OFF: Time = Time::from_ms(10);
/// The watchdog with the slowest oscillator that the data sheet allows.
const WATCHDOG: Time = Time::from_ms(115);
/// The heartbeat consumer of the master: so much of the producer's period, in
/// percent.
const CONSUMER_PERCENT: u64 = 250;
const HUNDRED: u64 = 100;
/// How often the master looks at its consumers, and time for the bus to carry a
/// frame of low priority.
const TICK: Time = Time::from_ms(2);

/// What goes wrong, as far as the contract tells it apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Cause {
    /// A drive's error that switches its power stage off (EMCY).
    DriveDisabled,
    /// A drive's error with a ramp (EMCY; 605Eh or 6007h).
    DriveStops,
    /// An EMCY that the drive itself does not act on.
    Emergency,
    /// A drive leaves operation enabled by itself, without an error.
    DropOut,
    /// Safe torque off.
    Sto,
    /// A drive's heartbeat stays away.
    HeartbeatLost,
    /// A drive's TPDOs stay away.
    TpdosMissing,
    /// A drive has lost its supply.
    SupplyLost,
    /// A drive was taken out of NMT operational by somebody else.
    LeftOperational,
    /// A shaft does not turn: following error.
    Blocked,
    /// The cable of one drive is cut.
    DriveCutOff,
    /// The cable of the master is cut.
    MasterCutOff,
    /// The bus is short-circuited.
    ShortCircuit,
    /// The master is reset.
    MasterReset,
    /// A task of the master hangs.
    MasterHangs,
}

/// Who brings an axis to rest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reaction {
    /// The master, by the cyclic target: all such axes come to rest together.
    Ramp,
    /// Its own drive, by its quick-stop ramp.
    QuickStop,
    /// Friction.
    Coasts,
    /// It stands already.
    Stands,
}

/// What the contract says of an axis, counted from the fault, or for
/// [`Cause::Blocked`] from when the error has become too large.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limit {
    /// From then on it does not start, and does not become faster.
    pub stops_by: Time,
    /// Then it stands.
    pub stands_by: Time,
    /// By whom.
    pub reaction: Reaction,
}

impl Limit {
    /// The same for an axis in another mode than those of which the master makes the
    /// ramp: what leads its own motion brakes on its own ramp, and one that follows a
    /// torque gets none.
    pub fn in_mode(self, mode: Mode) -> Limit {
        let reaction = match (self.reaction, mode) {
            (Reaction::Ramp, Mode::ProfilePosition | Mode::Homing) => Reaction::QuickStop,
            (Reaction::Ramp, Mode::CyclicTorque) => Reaction::Coasts,
            (reaction, _) => reaction,
        };
        Limit {
            stands_by: self.stops_by + reaction_time(reaction),
            reaction,
            ..self
        }
    }
}

/// What the contract says of all axes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Of the axis that has the fault, if one has.
    pub struck: Limit,
    /// Of the others.
    pub others: Limit,
}

impl Cause {
    /// Every cause.
    pub const ALL: [Cause; 15] = [
        Cause::DriveDisabled,
        Cause::DriveStops,
        Cause::Emergency,
        Cause::DropOut,
        Cause::Sto,
        Cause::HeartbeatLost,
        Cause::TpdosMissing,
        Cause::SupplyLost,
        Cause::LeftOperational,
        Cause::Blocked,
        Cause::DriveCutOff,
        Cause::MasterCutOff,
        Cause::ShortCircuit,
        Cause::MasterReset,
        Cause::MasterHangs,
    ];

    /// As a table names it.
    pub const fn words(self) -> &'static str {
        match self {
            Cause::DriveDisabled => "error of a drive: disabled",
            Cause::DriveStops => "error of a drive: ramp",
            Cause::Emergency => "emergency",
            Cause::DropOut => "drive drops out",
            Cause::Sto => "safe torque off",
            Cause::HeartbeatLost => "heartbeat lost",
            Cause::TpdosMissing => "TPDOs missing",
            Cause::SupplyLost => "drive without supply",
            Cause::LeftOperational => "NMT stop by another",
            Cause::Blocked => "axis blocked",
            Cause::DriveCutOff => "cable of a drive cut",
            Cause::MasterCutOff => "cable of the master cut",
            Cause::ShortCircuit => "short circuit",
            Cause::MasterReset => "master reset",
            Cause::MasterHangs => "master hangs",
        }
    }

    /// What the contract says for a machine on `network` that counts a drive's
    /// TPDOs as missing after `missing` cycles.
    pub fn limits(self, network: &Network, missing: u64) -> Limits {
        let cycle = Time::from(network.cycle);
        let cycles = |n: u64| Time(cycle.0 * n);
        let slowest = |ms: fn(&canmaster::network::Node) -> u16| {
            Time::from_ms(network.nodes.iter().map(ms).max().unwrap_or(0).into())
        };
        // The drive's 1016h, and what it was told last acts until then.
        let master_missed = slowest(|node| node.consumer_ms) + cycle + TICK;
        let producer = slowest(|node| node.heartbeat_ms);
        let node_missed = Time(producer.0 * CONSUMER_PERCENT / HUNDRED) + TICK;

        let limit = |after: Time, reaction| Limit {
            stops_by: after,
            stands_by: after + reaction_time(reaction),
            reaction,
        };
        let by_master = |detected: Time| limit(detected + cycles(STOP_SYNC), Reaction::Ramp);
        let by_itself = |detected: Time| limit(detected, Reaction::QuickStop);
        let both = |limit| Limits {
            struck: limit,
            others: limit,
        };
        let seen = cycles(ONE_CYCLE) + TICK;
        let missed = cycles(missing + ONE_CYCLE);
        let coasts = limit(Time::ZERO, Reaction::Coasts);
        let (struck, others) = match self {
            Cause::DriveDisabled | Cause::Sto | Cause::DropOut => (coasts, by_master(seen)),
            Cause::DriveStops => (by_itself(TICK), by_master(seen)),
            Cause::Emergency => return both(by_master(seen)),
            Cause::HeartbeatLost => return both(by_master(node_missed + cycle)),
            Cause::TpdosMissing => return both(by_master(missed)),
            Cause::SupplyLost => (coasts, by_master(missed)),
            // A stopped node sends no TPDOs; its next heartbeat says so, too.
            Cause::LeftOperational => (by_itself(TICK), by_master(missed)),
            Cause::Blocked => (limit(Time::ZERO, Reaction::Stands), by_master(seen)),
            Cause::DriveCutOff => (by_itself(master_missed), by_master(missed)),
            Cause::MasterCutOff | Cause::MasterReset => return both(by_itself(master_missed)),
            Cause::ShortCircuit => return both(by_itself(master_missed.max(BUS_OFF))),
            Cause::MasterHangs => return both(by_itself(WATCHDOG + master_missed)),
        };
        Limits { struck, others }
    }
}

fn reaction_time(reaction: Reaction) -> Time {
    let ramp = |slope: u64| Time::from_us(FASTEST_RPM * 1_000_000 / slope) + TAIL;
    match reaction {
        Reaction::Ramp => ramp(STOP_RPM_PER_S),
        Reaction::QuickStop => ramp(QUICK_STOP_RPM_PER_S),
        Reaction::Coasts => COASTS,
        Reaction::Stands => TAIL,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use canmaster::network::sample::SIX_EPOS4;

    #[test]
    fn the_table_of_the_sample() {
        let ms = |limit: Limit| (limit.stops_by.as_ms(), limit.stands_by.as_ms());
        let of = |cause: Cause| {
            let limits = cause.limits(&SIX_EPOS4, 3);
            (ms(limits.struck), ms(limits.others))
        };
        // 2200 rpm at 3000 rpm/s and 100 ms; at 10 000 rpm/s and 100 ms.
        assert_eq!(of(Cause::DriveDisabled), ((0, 7000), (8, 841)));
        assert_eq!(of(Cause::TpdosMissing), ((12, 845), (12, 845)));
        assert_eq!(of(Cause::HeartbeatLost), ((258, 1091), (258, 1091)));
        assert_eq!(of(Cause::DriveCutOff), ((204, 524), (12, 845)));
        assert_eq!(of(Cause::MasterReset), ((204, 524), (204, 524)));
        assert_eq!(of(Cause::MasterHangs), ((319, 639), (319, 639)));
    }

    #[test]
    fn what_the_master_does_not_ramp_has_times_of_its_own() {
        let others = |cause: Cause| cause.limits(&SIX_EPOS4, 3).others;
        let ms = |mode| others(Cause::DriveDisabled).in_mode(mode).stands_by.as_ms();
        for mode in Mode::ALL {
            let by_itself = others(Cause::MasterReset);
            assert_eq!(by_itself.in_mode(mode), by_itself);
            let expected = match mode {
                Mode::ProfilePosition | Mode::Homing => 328,
                Mode::CyclicTorque => 7008,
                _ => 841,
            };
            assert_eq!(ms(mode), expected, "{mode:?}");
        }
    }

    #[test]
    fn every_axis_stands_in_the_end() {
        for cause in Cause::ALL {
            let Limits { struck, others } = cause.limits(&SIX_EPOS4, 3);
            for limit in [struck, others] {
                assert!(limit.stops_by < limit.stands_by, "{cause:?}");
                assert!(limit.stands_by <= COASTS, "{cause:?}");
            }
        }
    }
}
