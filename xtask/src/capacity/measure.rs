//! The same by experiment: the library as master, simulated drives, random
//! payloads, and a count of what 0.1 s was enough for.

use anyhow::{Context, Result, bail, ensure};
use canmaster::id::{Address, FunctionCode, NodeId};
use canmaster::master::AxisPdos;
use canmaster::motion::AxisCommand;
use canmaster::motion::mode::Mode;
use canmaster::network::sample::SIX_EPOS4;
use canmaster::network::{self, Identity, Kind, Master, Network, Node, Pdo};
use canmaster::nmt::{Command, NodeControl, Target};
use canmaster::pdo::{MappingEntry, Transmission};
use canmaster::time::Duration;
use canmaster::{CobId, Frame, objects};
use canmaster_network::s1::{NODES_MAX, Row};
use canmaster_sim::bus::{RecordKind, WireRecord};
use canmaster_sim::time::Time;

use super::bench::{Bench, function};

/// In which every node is to be updated.
const INTERVAL: Time = Time::from_ms(100);
/// What the drive asks for: a millisecond for each frame of a node.
const SPACING: Time = Time::from_ms(1);
/// Four requests and their answers.
const SPACINGS: u32 = 8;
/// Room for the start of all nodes.
const SETTLE: Time = Time::from_ms(50);
const SEED: u64 = 1;
const US_PER_S: u64 = 1_000_000;

/// What was found at one bit rate.
pub(super) struct Measured {
    /// Nodes updated by SDO.
    pub(super) sdo: u32,
    /// By the formula, with the mean lengths of that run.
    pub(super) sdo_counted: u32,
    /// Nodes updated by PDO; above 127, node-IDs were used again.
    pub(super) pdo_uncapped: u32,
    /// By the formula, with the mean lengths of that run.
    pub(super) pdo_counted_uncapped: u32,
}

impl Measured {
    pub(super) fn at(row: &Row) -> Result<Measured> {
        let (sdo, sdo_counted) = sdo(row).context("updating by SDO")?;
        let (pdo_uncapped, pdo_counted_uncapped) = pdo(row).context("updating by PDO")?;
        Ok(Measured {
            sdo,
            sdo_counted,
            pdo_uncapped,
            pdo_counted_uncapped,
        })
    }
}

/// SplitMix64: the same payloads on every computer.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A command that a drive takes: no bit of the controlword that would enable
    /// it, a velocity within its limits, no ramp of 0.
    fn command(&mut self) -> AxisCommand {
        const ENABLE_OPERATION: u16 = 1 << 3;
        const VELOCITY_MAX: i64 = 100_000;
        AxisCommand {
            controlword: self.next() as u16 & !ENABLE_OPERATION,
            mode: Mode::ProfileVelocity,
            target: (self.next() as i64 % (VELOCITY_MAX + 1)) as i32,
            acceleration: self.next() as u32 | 1,
            deceleration: self.next() as u32 | 1,
        }
    }
}

/// The four parameters as they are written: where, and the bytes.
fn parameters(command: &AxisCommand) -> [(Address, Vec<u8>); 4] {
    [
        (
            objects::CONTROLWORD,
            command.controlword.to_le_bytes().into(),
        ),
        (
            objects::TARGET_VELOCITY,
            command.target.to_le_bytes().into(),
        ),
        (
            objects::PROFILE_ACCELERATION,
            command.acceleration.to_le_bytes().into(),
        ),
        (
            objects::PROFILE_DECELERATION,
            command.deceleration.to_le_bytes().into(),
        ),
    ]
}

/// More than can be updated, and no more than there can be.
fn drives(exact: u32) -> u8 {
    (exact + exact / 2 + 2).min(NODES_MAX) as u8
}

fn sdo(row: &Row) -> Result<(u32, u32)> {
    let count = drives(row.sdo_exact);
    let mut bench = Bench::new(row.bit_rate, count, SPACING.as_us(), SEED);
    bench.await_boot()?;
    bench.run_until(bench.now() + SETTLE);
    bench.take_records();
    let mut random = Random(SEED);
    let end = bench.now() + INTERVAL;
    let mut updated = 0;
    'interval: for node in (1..=count).filter_map(NodeId::new) {
        for (at, data) in parameters(&random.command()) {
            bench.download(node, at, &data)?;
            // The answer came too late.
            if bench.now() > end {
                break 'interval;
            }
            bench.run_until(bench.now() + SPACING);
        }
        updated += 1;
    }
    ensure!(updated < u32::from(count), "{count} drives were too few");
    let records = bench.take_records();
    let bits = records
        .iter()
        .map(|record| u64::from(record.bits))
        .sum::<u64>();
    // floor(0.1 / (mean bits of a node / rate + 0.008)), a node being eight frames;
    // times the number of frames, so that nothing is rounded before the end.
    let frames = records.len() as u64;
    let of_a_node = bits * u64::from(SPACINGS);
    let rate = u64::from(row.bit_rate);
    let spacing = frames * SPACING.as_us() * u64::from(SPACINGS) * rate;
    let counted = INTERVAL.as_us() * rate * frames / (of_a_node * US_PER_S + spacing);
    Ok((updated, counted as u32))
}

/// What the two RPDOs of a node carry.
const fn mapped(at: Address, bits: u8) -> MappingEntry {
    MappingEntry::new(at.index.0, at.sub.0, bits)
}

const RPDOS: &[Pdo] = &[
    Pdo {
        number: 1,
        transmission: Transmission::Synchronous(1),
        mapping: &[
            mapped(objects::CONTROLWORD, 16),
            mapped(objects::TARGET_VELOCITY, 32),
        ],
    },
    Pdo {
        number: 2,
        transmission: Transmission::Synchronous(1),
        mapping: &[
            mapped(objects::PROFILE_ACCELERATION, 32),
            mapped(objects::PROFILE_DECELERATION, 32),
        ],
    },
];

/// Nodes that only receive, so that nothing else is on the bus.
fn node(id: NodeId) -> Node {
    Node {
        id,
        mandatory: true,
        name: "drive",
        serial: None,
        kind: &RECEIVER,
    }
}

const RECEIVER: Kind = Kind {
    identity: Identity {
        device_type: None,
        vendor: None,
        product: None,
        revision: None,
    },
    heartbeat_ms: 0,
    consumer_ms: 0,
    rpdos: RPDOS,
    tpdos: &[],
    start_values: &[],
    sdo_timeout: Duration::ZERO,
    configured: [0; 2],
};

fn pdo(row: &Row) -> Result<(u32, u32)> {
    const ANSWER_US: u64 = 200;
    let count = drives(row.pdo_exact_uncapped);
    let mut bench = Bench::new(row.bit_rate, count, ANSWER_US, SEED);
    bench.await_boot()?;
    let nodes: Vec<NodeId> = (1..=count).filter_map(NodeId::new).collect();
    let described: Vec<Node> = nodes.iter().map(|id| node(*id)).collect();
    let network: &'static Network = Box::leak(Box::new(Network {
        bit_rate: row.bit_rate,
        cycle: Duration::from_millis(INTERVAL.as_ms() as u32),
        master: Master {
            node: NodeId::MAX,
            heartbeat: Duration::ZERO,
            silence: Duration::ZERO,
            boot_time: Duration::ZERO,
            sdo_tries: 1,
            syncs_before_start: 0,
        },
        nodes: described.leak(),
    }));
    for node in network.nodes {
        for write in network::plan(network, node) {
            let bytes = write.bytes();
            bench.download(node.id, write.at, &bytes[..write.len()])?;
        }
    }
    let start = NodeControl {
        command: Command::Start,
        target: Target::All,
    };
    bench.send(start.frame());
    bench.flush(bench.now() + INTERVAL)?;
    bench.run_until(bench.now() + SETTLE);
    // Between those that certainly fit and those that certainly do not.
    let mut fits = row.pdo_exact_uncapped;
    let mut too_many = fits + fits / 2 + 2;
    let mut round = round_of(&mut bench, &nodes, fits)?;
    ensure!(
        round.length <= INTERVAL,
        "{fits} nodes do not fit, and the formula says so"
    );
    while fits + 1 < too_many {
        let tried = (fits + too_many) / 2;
        let found = round_of(&mut bench, &nodes, tried)?;
        if found.length <= INTERVAL {
            (fits, round) = (tried, found);
        } else {
            too_many = tried;
        }
    }
    // Once more, and then every drive is asked what it has.
    let found = round_of(&mut bench, &nodes, fits)?;
    ensure!(
        found.length == round.length,
        "the same round took another time"
    );
    for (node, command) in found.commands {
        for (at, data) in parameters(&command) {
            let has = bench.upload(node, at)?;
            ensure!(has.data() == data, "node {node}: {at} was not updated");
        }
    }
    // floor((0.1 - sync / rate) / (bits / rate)), the bits of a node being the mean.
    let interval = u64::from(row.bit_rate) * INTERVAL.as_us() / US_PER_S;
    let room = interval - u64::from(found.sync_bits);
    Ok((fits, (room * u64::from(fits) / found.rpdo_bits) as u32))
}

/// All nodes updated once.
struct Round {
    /// From the first start of frame to the end of the SYNC's interframe space.
    length: Time,
    rpdo_bits: u64,
    sync_bits: u32,
    /// What each node got last.
    commands: Vec<(NodeId, AxisCommand)>,
}

fn round_of(bench: &mut Bench, ids: &[NodeId], nodes: u32) -> Result<Round> {
    // The same payloads in every round.
    let mut random = Random(SEED);
    let mut commands = Vec::new();
    // The nodes are mapped like those of the sample.
    let mut nodes_of_sample = SIX_EPOS4.nodes.iter();
    let pdos = nodes_of_sample.find_map(AxisPdos::of);
    let pdos = pdos.context("the sample maps no velocity")?;
    bench.take_records();
    for n in 0..nodes as usize {
        let id = ids[n % ids.len()];
        let command = random.command();
        let frames = [pdos.cyclic(&command, id), pdos.ramps(&command, id)];
        for frame in frames.into_iter().flatten() {
            bench.send(frame);
        }
        commands.retain(|(other, _)| *other != id);
        commands.push((id, command));
    }
    bench.send(Frame::empty(CobId::SYNC));
    bench.flush(bench.now() + INTERVAL + INTERVAL)?;
    bench.run_until(bench.now() + SETTLE);
    let records = bench.take_records();
    let is = |record: &&WireRecord, wanted: FunctionCode| match &record.kind {
        RecordKind::Frame(frame) => function(frame) == Some(wanted),
        RecordKind::ErrorFrame { .. } => false,
    };
    let (Some(first), Some(last)) = (records.first(), records.last()) else {
        bail!("nothing was sent");
    };
    let strange = records.iter().find(|record| !bench.is_masters(record));
    ensure!(
        strange.is_none(),
        "somebody else was on the bus: {strange:?}"
    );
    let rpdos = records
        .iter()
        .filter(|record| is(record, FunctionCode::Rpdo1) || is(record, FunctionCode::Rpdo2));
    Ok(Round {
        length: last.end.since(first.sof),
        rpdo_bits: rpdos.map(|record| u64::from(record.bits)).sum(),
        sync_bits: last.bits,
        commands,
    })
}
