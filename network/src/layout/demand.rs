//! What a cycle has to hold.

use std::cmp::Reverse;

use super::{NS_PER_S, NS_PER_US, PER_MILLE, US_PER_MS};
use crate::frame::{EMCY_BYTES, HEARTBEAT_BYTES, SDO_BYTES, SYNC_BYTES, TIME_BYTES, longest_bits};
use crate::model::{Node, Pdo, Send};

/// When the RPDOs go that answer to TPDOs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RpdoOrder {
    /// As soon as they are computed, in the same cycle.
    #[default]
    AfterTpdos,
    /// Directly after the next SYNC.
    AfterSync,
}

/// A frame that comes in every cycle: COB-ID, whose, bytes.
pub type Cyclic = (u16, String, u8);

/// What a layout is made from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Demand {
    /// bit/s; a whole number of nanoseconds each.
    pub bit_rate: u32,
    /// The greatest part of the cycle that may be taken, per mille.
    pub load_limit: u32,
    /// From the last TPDO to the first RPDO, in microseconds.
    pub compute_us: u32,
    /// Before the next SYNC, in microseconds.
    pub guard_us: u32,
    /// When the RPDOs go that answer to TPDOs.
    pub order: RpdoOrder,
    /// SDO frames in one cycle.
    pub sdo_frames: u32,
    /// A planned SDO exchange is begun every so many cycles; 0: none is.
    pub sdo_every: u32,
    /// The soonest and the slowest answer to an SDO request, in microseconds.
    /// `None`: nobody knows, so that SDO frames come when they come.
    pub sdo_latency_us: Option<(u32, u32)>,
    /// EMCY frames in one cycle.
    pub emcy_frames: u32,
    /// Heartbeats of nodes may wait for a later cycle.
    pub heartbeats_wait: bool,
    /// The soonest node's time from SYNC to its TPDOs, in microseconds.
    pub earliest_us: u32,
    /// The slowest node's time from SYNC to its TPDOs, in microseconds.
    pub latency_us: u32,
    /// When the TPDOs of the other buses are there, in microseconds: the axes are
    /// stepped together.
    pub elsewhere_us: u32,
    /// Producer heartbeat times, in milliseconds: who, how often; the master's
    /// first.
    pub heartbeats: Vec<(String, u16)>,
    /// The PDOs of every cycle, most urgent first.
    pub tpdos: Vec<Cyclic>,
    /// The same of the master's that answer to TPDOs.
    pub rpdos: Vec<Cyclic>,
    /// The same of the master's that need no fresh TPDO.
    pub ramps: Vec<Cyclic>,
    /// Those of the master's that are sent on change, one in a cycle.
    pub on_change: Vec<Cyclic>,
}

impl Demand {
    /// The nodes of one bus and the master's heartbeat.
    pub fn of<'a>(
        nodes: impl Iterator<Item = &'a Node>,
        master_heartbeat_ms: u16,
        bit_rate: u32,
    ) -> Demand {
        let mut demand = Demand {
            bit_rate,
            load_limit: PER_MILLE as u32,
            compute_us: 0,
            guard_us: 0,
            order: RpdoOrder::AfterTpdos,
            sdo_frames: 0,
            sdo_every: 0,
            sdo_latency_us: None,
            emcy_frames: 0,
            heartbeats_wait: false,
            earliest_us: u32::MAX,
            latency_us: 0,
            elsewhere_us: 0,
            heartbeats: vec![("master".to_string(), master_heartbeat_ms)],
            tpdos: Vec::new(),
            rpdos: Vec::new(),
            ramps: Vec::new(),
            on_change: Vec::new(),
        };
        let mut answers = Vec::new();
        for node in nodes {
            let of = |pdo: &Pdo| {
                let what = format!("{}{} of {}", pdo.direction.word(), pdo.number, node.name);
                (pdo.cob_id(node.id), what, pdo.bytes())
            };
            demand.tpdos.extend(node.tpdos.iter().map(of));
            // Of those with a controlword, the one of the active mode is sent: there is
            // room for the longest.
            let with_modes = node.rpdos.iter().filter(|pdo| pdo.is_of_a_mode());
            let longest = with_modes.map(|pdo| (pdo.bytes(), Reverse(pdo.number)));
            let longest = longest.max().map(|(_, Reverse(number))| number);
            for pdo in &node.rpdos {
                if pdo.is_of_a_mode() && Some(pdo.number) != longest {
                    continue;
                }
                let list = match (pdo.send, pdo.answers_to_tpdos()) {
                    (Send::OnChange, _) => &mut demand.on_change,
                    (Send::EveryCycle, false) => &mut demand.ramps,
                    (Send::EveryCycle, true) => &mut demand.rpdos,
                };
                list.push(of(pdo));
            }
            let heartbeat = match node.heartbeat_in_operational {
                true => node.heartbeat_ms,
                false => 0,
            };
            demand.heartbeats.push((node.name.clone(), heartbeat));
            demand.earliest_us = demand.earliest_us.min(node.tpdo_earliest_us);
            demand.latency_us = demand.latency_us.max(node.tpdo_latency_us);
            answers.push(node.sdo_latency_us);
        }
        demand.earliest_us = demand.earliest_us.min(demand.latency_us);
        // Of all of them, if all of them are known.
        let all: Option<Vec<(u32, u32)>> = answers.into_iter().collect();
        demand.sdo_latency_us = all.and_then(|all| {
            let least = all.iter().map(|(least, _)| *least).min()?;
            let most = all.iter().map(|(_, most)| *most).max()?;
            Some((least, most))
        });
        // The order in which they win the bus.
        for list in [
            &mut demand.tpdos,
            &mut demand.rpdos,
            &mut demand.ramps,
            &mut demand.on_change,
        ] {
            list.sort();
        }
        demand
    }

    /// The pure wire bound: SYNC and the PDOs of every cycle one behind the other
    /// without a gap, each with the most stuff bits, in microseconds.
    pub fn wire_bound_us(&self) -> u32 {
        let pdos = [&self.tpdos, &self.rpdos, &self.ramps];
        let pdos = pdos.into_iter().flatten();
        let bits: u32 = pdos.map(|(_, _, bytes)| longest_bits(*bytes)).sum();
        self.us(longest_bits(SYNC_BYTES) + bits)
    }

    pub(crate) fn bit_ns(&self) -> u64 {
        NS_PER_S / u64::from(self.bit_rate.max(1))
    }

    pub(super) fn bits_ns(&self, bits: u32) -> u64 {
        u64::from(bits) * self.bit_ns()
    }

    /// So many bits in microseconds, rounded up.
    pub(crate) fn us(&self, bits: u32) -> u32 {
        self.bits_ns(bits).div_ceil(NS_PER_US) as u32
    }

    /// Whether the master decides when SDO frames are on the wire, so that one slot
    /// serves them, its heartbeat and RPDOs on change.
    pub fn is_planned(&self) -> bool {
        self.sdo_latency_us.is_some()
    }

    /// Bytes of the longest frame that the planned slot may hold; `None`: there is
    /// no such slot.
    pub(super) fn planned_bytes(&self) -> Option<u8> {
        let on_change = self.on_change.iter().map(|(_, _, bytes)| *bytes).max();
        if !self.is_planned() {
            return on_change;
        }
        let sdo = if self.sdo_frames > 0 { SDO_BYTES } else { 0 };
        Some(on_change.unwrap_or(0).max(sdo).max(TIME_BYTES))
    }

    /// Frames without a place of their own: what they are, and their bytes.
    pub(super) fn others(&self, cycle_us: u32) -> Vec<(String, u8)> {
        let mut others = vec![("EMCY".to_string(), EMCY_BYTES); self.emcy_frames as usize];
        let times = |ms: u16| match u32::from(ms) * US_PER_MS {
            0 => 0,
            period_us => cycle_us.div_ceil(period_us) as usize,
        };
        let beat = |who: &str| (format!("heartbeat of {who}"), HEARTBEAT_BYTES);
        let mut nodes = self.heartbeats.iter();
        let master = nodes.next().filter(|_| !self.is_planned());
        if let Some((who, ms)) = master {
            others.extend(std::iter::repeat_n(beat(who), times(*ms)));
        }
        if self.heartbeats_wait {
            let mean = mean_frames(nodes.map(|(_, ms)| *ms), cycle_us);
            others.extend(std::iter::repeat_n(beat("a node"), mean));
        } else {
            for (who, ms) in nodes {
                others.extend(std::iter::repeat_n(beat(who), times(*ms)));
            }
        }
        // One of them has the planned slot.
        let sdo = self.sdo_frames - u32::from(self.is_planned()).min(self.sdo_frames);
        others.extend(vec![("SDO".to_string(), SDO_BYTES); sdo as usize]);
        others
    }
}

/// Heartbeats that come in a cycle on the average, rounded up.
fn mean_frames(periods_ms: impl Iterator<Item = u16>, cycle_us: u32) -> usize {
    const PARTS: u64 = 1_000_000;
    let parts: u64 = periods_ms
        .filter(|ms| *ms != 0)
        .map(|ms| (u64::from(cycle_us) * PARTS).div_ceil(u64::from(ms) * u64::from(US_PER_MS)))
        .sum();
    parts.div_ceil(PARTS) as usize
}
