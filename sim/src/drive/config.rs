//! What one simulated drive is like, and what is wrong with it.

use super::cia402::State;
use super::mangle::SdoWrong;
use super::plant::PlantConfig;
use super::random::{self, Random};
use super::servo::ServoConfig;
use super::test_data::TestData;
use crate::time::Time;
use canmaster::NodeId;

/// Drawn uniformly from this for each use, microseconds of the drive's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Spread {
    /// The shortest.
    pub min_us: u64,
    /// The longest.
    pub max_us: u64,
}

impl Spread {
    /// From `min_us` to `max_us`.
    pub const fn new(min_us: u64, max_us: u64) -> Spread {
        Spread { min_us, max_us }
    }

    /// Always the same.
    pub const fn fixed(us: u64) -> Spread {
        Spread::new(us, us)
    }

    pub(super) fn draw(self, random: &mut Random) -> u64 {
        random.integer(self.min_us, self.max_us)
    }
}

/// 1000h and 1018h.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Identity {
    /// 1000h.
    pub device_type: u32,
    /// 1018h:1.
    pub vendor: u32,
    /// 1018h:2.
    pub product: u32,
    /// 1018h:3.
    pub revision: u32,
    /// 1018h:4.
    pub serial: u32,
}

impl Identity {
    /// EPOS4 50/5 Compact, firmware 0170h.
    pub const fn epos4(serial: u32) -> Identity {
        Identity {
            device_type: 0x0002_0192,
            vendor: 0x0000_00FB,
            product: 0x6150_0000,
            revision: 0x0170_0000,
            serial,
        }
    }
}

/// Serial numbers of the simulated drives start here.
const FIRST_SERIAL: u32 = 0x2600_0000;
/// Largest error of a drive's crystal, parts per million.
const CLOCK_PPM: f64 = 100.0;

/// Everything that describes one drive.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveConfig {
    /// Its node-ID; without one (see [`unconfigured`](Self::unconfigured)),
    /// its place in the machine.
    pub node: NodeId,
    /// From the factory without node-ID: 2000h is 255 until LSS gives it one.
    pub unconfigured: bool,
    /// Seed of its noise and of every latency.
    pub seed: u64,
    /// Who it says it is.
    pub identity: Identity,
    /// Its clock is this many parts per million fast.
    pub clock_ppm: f64,
    /// bit/s.
    pub bit_rate: u32,
    /// When its supply comes on first.
    pub power_on: Time,
    /// From power-on or NMT reset to the boot-up frame, 0.2 .. 0.6 s.
    pub boot: Spread,
    /// From an SDO request to its answer, 0.2 .. 1.0 ms (field: up to 15 ms).
    pub sdo_latency: Spread,
    /// Segments per block that its SDO server takes; 0: it answers block
    /// transfers with 05040001h. Unproven on the real drive.
    pub sdo_block_size: u8,
    /// It has an object for tests of a client, which no EPOS4 has.
    pub test_data: Option<TestData>,
    /// From an LSS request to its answer.
    pub lss_latency: Spread,
    /// How much longer saving and restoring take (1010h, 1011h).
    pub store_time: Spread,
    /// It has node guarding (100Ch, 100Dh), which the EPOS4 has not.
    pub node_guarding: bool,
    /// From SYNC to the request to send the TPDOs, 50 .. 250 us.
    pub tpdo_delay: Spread,
    /// How long it stays off the bus after bus-off.
    pub bus_off_pause: Spread,
    /// The velocity loop.
    pub servo: ServoConfig,
    /// Motor and load.
    pub plant: PlantConfig,
    /// What goes wrong, and when.
    pub faults: Vec<DriveFault>,
}

impl DriveConfig {
    /// Drive `node` of the machine that `seed` describes: clock, time constant,
    /// inertia and friction are drawn from it.
    pub fn new(node: NodeId, seed: u64) -> DriveConfig {
        let seed = seed
            .wrapping_mul(1 << 7)
            .wrapping_add(u64::from(node.get()));
        let mut draw = Random::new(seed, random::SPREAD);
        DriveConfig {
            node,
            unconfigured: false,
            seed,
            identity: Identity::epos4(FIRST_SERIAL + u32::from(node.get())),
            clock_ppm: CLOCK_PPM * draw.symmetric(),
            bit_rate: 1_000_000,
            power_on: Time::ZERO,
            boot: Spread::new(200_000, 600_000),
            sdo_latency: Spread::new(200, 1000),
            sdo_block_size: 0,
            test_data: None,
            lss_latency: Spread::new(200, 1000),
            store_time: Spread::fixed(50_000),
            node_guarding: false,
            tpdo_delay: Spread::new(50, 250),
            bus_off_pause: Spread::fixed(100_000),
            servo: ServoConfig {
                time_constant_s: draw.between(0.003, 0.010),
                ..ServoConfig::default()
            },
            plant: PlantConfig {
                inertia_ratio: draw.between(0.7, 1.3),
                friction_permille: draw.between(20.0, 50.0),
                // An incremental encoder counts from where the power came on.
                start_position: 0.0,
                ..PlantConfig::default()
            },
            faults: Vec::new(),
        }
    }

    /// The same drive with one more fault.
    pub fn with(mut self, fault: DriveFault) -> DriveConfig {
        self.faults.push(fault);
        self
    }
}

/// Something that is wrong with a drive. Several can be combined.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveFault {
    /// It is another device than expected.
    Identity(Identity),
    /// Its switches are set to this node-ID, perhaps that of another drive: two
    /// answer on one COB-ID then. They go before 2000h; takes effect with the
    /// next reset of the communication.
    NodeSwitches(NodeId),
    /// Its memory for parameters is broken: 1010h and 1011h are answered with
    /// 06060000h, LSS store with error 2.
    StoreFails,
    /// Every SDO write to this entry is answered with this abort code.
    RefuseWrite {
        /// Index of the entry.
        index: u16,
        /// Sub-index of the entry.
        sub: u8,
        /// The abort code.
        abort: u32,
    },
    /// Its SDO answers take this long.
    SdoLatency(Spread),
    /// From then on it answers no SDO request.
    SdoDead {
        /// Since when.
        at: Time,
    },
    /// Its SDO answers are wrong.
    SdoWrong(SdoWrong),
    /// From then on controlwords change nothing: no transition is confirmed.
    ControlwordIgnored {
        /// Since when.
        at: Time,
    },
    /// Controlwords act this much later.
    ControlwordLate(Spread),
    /// Something is wrong in one state of CiA 402, each time that it is entered.
    InState {
        /// The state.
        state: State,
        /// What.
        what: Trouble,
    },
    /// From then on 6061h does not follow 6060h.
    ModeStuck {
        /// Since when.
        at: Time,
    },
    /// From then on its heartbeats are missing; everything else works.
    HeartbeatLost {
        /// Since when.
        at: Time,
    },
    /// From then on its TPDOs are missing; everything else works.
    TpdosLost {
        /// Since when.
        at: Time,
    },
    /// The supply fails: silence, and the motor coasts.
    PowerLoss {
        /// When.
        at: Time,
    },
    /// The supply fails and comes back.
    PowerCycle {
        /// When it fails.
        off: Time,
        /// When it is back.
        on: Time,
    },
    /// A load comes on the shaft, in addition to friction and in place of the
    /// load configured.
    Load {
        /// Since when.
        at: Time,
        /// Torque, per mille of rated torque; positive drives in the positive
        /// direction.
        permille: i32,
    },
    /// The shaft does not turn, whatever the torque: something blocks the axis.
    Blocked {
        /// Since when.
        at: Time,
        /// Until when; `None`: for ever.
        until: Option<Time>,
    },
    /// Safe torque off: no torque, 8A88h, and no reset as long as it lasts.
    Sto {
        /// Since when.
        at: Time,
        /// Until when; `None`: for ever.
        until: Option<Time>,
    },
    /// It warns of an overload (FF01h) and takes that back, again and again, at
    /// SYNCs that it counts while it is operational.
    Warnings {
        /// So many SYNCs from one warning to the next, at least 2.
        every: u32,
        /// The first comes at this one, counted from 0.
        turn: u32,
        /// From the SYNC to the EMCY, and from the next SYNC to that with code 0.
        delay: Spread,
    },
    /// An error occurs in the drive: EMCY and reaction as its code has them.
    Error {
        /// When.
        at: Time,
        /// Its code: 2310h overcurrent, 8611h following error, FF01h warning.
        code: u16,
        /// Until when its cause lasts; before, a fault reset is in vain.
        /// `None`: the cause is gone at once.
        until: Option<Time>,
    },
}

/// What is wrong with a drive in one state of CiA 402.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trouble {
    /// Controlwords change nothing there: the next state is never confirmed.
    Deaf,
    /// A controlword acts this much later there: the one that is the newest then.
    Slow(Spread),
    /// It does not stay there: the power stage loses its voltage or its enabling
    /// input, which is no error (CiA 402-2, transitions 7, 9, 10 and 12).
    DropsOut {
        /// So long after entering, microseconds.
        after_us: u64,
    },
    /// An error occurs there.
    Error {
        /// So long after entering, microseconds.
        after_us: u64,
        /// Its code.
        code: u16,
    },
    /// The supply fails there.
    PowerLoss {
        /// So long after entering, microseconds.
        after_us: u64,
    },
}
