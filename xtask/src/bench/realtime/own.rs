//! What the board says of itself (2F20h), beside what is seen from outside.

use anyhow::{Context, Result};
use canmaster_sim::board::BoardStats;
use canmaster_sim::bus::{RecordKind, WireRecord};
use canmaster_sim::frame::WireId;
use canmaster_sim::judge::bus::syncs;
use canmaster_sim::judge::realtime::jitter_of_all;
use canmaster_sim::time::Time;
use canmaster_sim::world::{BusRecord, Client};
use serde::Serialize;

use super::session::Span;

/// The object, and what its entries are.
const MEASURED: u16 = 0x2F20;
const JITTER: u8 = 1;
const CYCLE: u8 = 3;
const SYNC_TICK: u8 = 4;
const CAN_IRQ: u8 = 5;
const PDO_PRODUCER: u8 = 6;
const NETWORK: u8 = 7;
const BUS_LOAD: u8 = 8;
const CPU_LOAD: u8 = 9;
const OVERRUNS: u8 = 10;
const RPDOS_LATE: u8 = 11;
const SYNCS_NOT_SENT: u8 = 12;
const ANSWERS: u8 = 13;

/// The board's jitter and that of the wire may differ by so much, microseconds.
const JITTER_US: f64 = 1.0;
/// A frame that was handed over before a SYNC and sent behind it counts in the cycle
/// before: bits of the longest, without stuff bits.
const FRAME_BITS: f64 = 111.0;
/// The board's load is that of the last second.
const CPU_LOAD_LIMIT: f64 = 0.01;
/// Answers on their way when the counting begins, and when it ends, and those that come
/// while the board is asked for what it has counted: some 100 ms on a bus that is full.
const ANSWERS_UNDER_WAY: u32 = 10;
const PER_MILLE: f64 = 1000.0;
/// Of a frame without data, with the interframe space.
const EMPTY_BITS: u32 = 47;

/// What is counted since the start.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counters {
    overruns: u32,
    rpdos_late: u32,
    syncs_not_sent: u32,
    answers: u32,
}

/// The names are the JSON object's. Beside each figure of the board stands what was
/// measured from outside.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Own {
    pub(super) jitter_pp_us: f64,
    /// Of all buses against one grid: least, as the times at which the board begins and
    /// ends to look are not known exactly, and most.
    wire_jitter_pp_us: [f64; 2],
    /// From the tick until the RPDOs were handed over.
    cycle_max_us: u32,
    /// Worst cycles of the tasks, with what preempted them.
    sync_tick_cycles: u32,
    can_irq_cycles: u32,
    pdo_producer_cycles: u32,
    network_cycles: u32,
    /// Without stuff bits.
    load_max: f64,
    wire_load_max: [f64; 2],
    pub(super) cpu_load: f64,
    board_cpu_load: f64,
    overruns: u32,
    rpdos_late: u32,
    syncs_not_sent: u32,
    answers: u32,
    wire_answers: u32,
    /// What a frame is of a cycle.
    #[serde(skip)]
    frame: f64,
}

fn number(client: &mut Client<'_>, sub: u8) -> Result<u32> {
    client
        .number(MEASURED, sub)
        .with_context(|| format!("2F20h:{sub:02} of the board cannot be read"))
}

impl Counters {
    fn read(client: &mut Client<'_>) -> Result<Counters> {
        Ok(Counters {
            overruns: number(client, OVERRUNS)?,
            rpdos_late: number(client, RPDOS_LATE)?,
            syncs_not_sent: number(client, SYNCS_NOT_SENT)?,
            answers: number(client, ANSWERS)?,
        })
    }

    /// Reads the counters, and has the board begin anew with the rest.
    pub(super) fn begin(client: &mut Client<'_>) -> Result<Counters> {
        let counters = Counters::read(client)?;
        client
            .put(MEASURED, JITTER, 0, 4)
            .context("2F20h:01 of the board cannot be written")?;
        Ok(counters)
    }
}

impl Own {
    /// Reads what the board says; the figure of the SYNCs first, since what is read
    /// afterwards may stand in their way. Gives the moment at which that was read.
    pub(super) fn read(client: &mut Client<'_>, before: Counters) -> Result<(Own, Time)> {
        let jitter = number(client, JITTER)?;
        let read = client.world.now();
        let after = Counters::read(client)?;
        let per_mille = |number: u32| f64::from(number) / PER_MILLE;
        let own = Own {
            jitter_pp_us: jitter.into(),
            cycle_max_us: number(client, CYCLE)?,
            sync_tick_cycles: number(client, SYNC_TICK)?,
            can_irq_cycles: number(client, CAN_IRQ)?,
            pdo_producer_cycles: number(client, PDO_PRODUCER)?,
            network_cycles: number(client, NETWORK)?,
            load_max: per_mille(number(client, BUS_LOAD)?),
            cpu_load: per_mille(number(client, CPU_LOAD)?),
            overruns: after.overruns - before.overruns,
            rpdos_late: after.rpdos_late - before.rpdos_late,
            syncs_not_sent: after.syncs_not_sent - before.syncs_not_sent,
            answers: after.answers - before.answers,
            ..Own::default()
        };
        Ok((own, read))
    }

    /// Puts beside it what was seen from outside.
    pub(super) fn beside(
        self,
        buses: &[BusRecord],
        span: &Span,
        cycle: Time,
        bit_rate: u32,
        stats: &BoardStats,
        answers: usize,
    ) -> Own {
        let jitter = |from: Time, to: Time| {
            let wires: Vec<&[WireRecord]> = buses
                .iter()
                .map(|bus| super::figures::between(&bus.wire, from, to))
                .collect();
            jitter_of_all(&wires, cycle)
        };
        let bits = f64::from(bit_rate) * cycle.as_secs_f64();
        let load = |from: Time, to: Time| {
            let wires = buses.iter();
            let loads = wires.map(|bus| busiest(super::figures::between(&bus.wire, from, to)));
            f64::from(loads.max().unwrap_or(0)) / bits
        };
        Own {
            wire_jitter_pp_us: [jitter(span.from, span.to), jitter(span.before, span.after)],
            wire_load_max: [load(span.from, span.to), load(span.before, span.after)],
            board_cpu_load: stats.cpu_load(),
            wire_answers: answers as u32,
            frame: FRAME_BITS / bits,
            ..self
        }
    }

    /// Where the board is wrong about itself, or says that something went wrong.
    pub(super) fn complaints(&self) -> Vec<String> {
        let mut words = Vec::new();
        let mut differs = |what: &str, own: f64, [least, most]: [f64; 2], by: f64| {
            // Numbers with a fraction that is not exact.
            const EXACT: f64 = 1e-6;
            if own < least - by - EXACT || own > most + by + EXACT {
                words.push(format!(
                    "the board measures {what} {own:.3}, and it is {least:.3} .. {most:.3}: \
                     more than {by:.3} apart"
                ));
            }
        };
        let wire = self.wire_jitter_pp_us;
        differs("a SYNC jitter [us] of", self.jitter_pp_us, wire, JITTER_US);
        let wire = self.wire_load_max;
        differs("a bus load of", self.load_max, wire, self.frame);
        let board = [self.board_cpu_load; 2];
        differs("a CPU load of", self.cpu_load, board, CPU_LOAD_LIMIT);
        if self.answers.abs_diff(self.wire_answers) > ANSWERS_UNDER_WAY {
            words.push(format!(
                "the board counts {} answers, and there were {}",
                self.answers, self.wire_answers
            ));
        }
        for (what, count) in [
            ("overruns", self.overruns),
            ("RPDOs late", self.rpdos_late),
            ("SYNCs not sent", self.syncs_not_sent),
        ] {
            if count != 0 {
                words.push(format!("{what}, as the board counts them: {count}"));
            }
        }
        words
    }

    /// The worst of both. What differs in one of them is told by that.
    pub(super) fn and(self, other: Own) -> Own {
        let worse = |one: [f64; 2], other: [f64; 2]| [0, 1].map(|n: usize| one[n].max(other[n]));
        Own {
            jitter_pp_us: self.jitter_pp_us.max(other.jitter_pp_us),
            wire_jitter_pp_us: worse(self.wire_jitter_pp_us, other.wire_jitter_pp_us),
            cycle_max_us: self.cycle_max_us.max(other.cycle_max_us),
            sync_tick_cycles: self.sync_tick_cycles.max(other.sync_tick_cycles),
            can_irq_cycles: self.can_irq_cycles.max(other.can_irq_cycles),
            pdo_producer_cycles: self.pdo_producer_cycles.max(other.pdo_producer_cycles),
            network_cycles: self.network_cycles.max(other.network_cycles),
            load_max: self.load_max.max(other.load_max),
            wire_load_max: worse(self.wire_load_max, other.wire_load_max),
            cpu_load: self.cpu_load.max(other.cpu_load),
            board_cpu_load: self.board_cpu_load.max(other.board_cpu_load),
            overruns: self.overruns + other.overruns,
            rpdos_late: self.rpdos_late + other.rpdos_late,
            syncs_not_sent: self.syncs_not_sent + other.syncs_not_sent,
            answers: self.answers + other.answers,
            wire_answers: self.wire_answers + other.wire_answers,
            frame: self.frame,
        }
    }
}

/// Bits of the frames from one SYNC to the next, without stuff bits: most of them.
fn busiest(wire: &[WireRecord]) -> u32 {
    let places = syncs(wire);
    let mut most = 0;
    for pair in places.windows(2) {
        let frames = super::figures::between(wire, pair[0], pair[1]).iter();
        let bits = frames.map(|record| match &record.kind {
            RecordKind::Frame(frame) if matches!(frame.id, WireId::Standard(_)) => {
                EMPTY_BITS + u32::from(frame.dlc.min(8)) * u8::BITS
            }
            _ => 0,
        });
        most = most.max(bits.sum());
    }
    most
}

#[cfg(test)]
mod tests {
    use super::*;

    fn own() -> Own {
        Own {
            jitter_pp_us: 2.0,
            wire_jitter_pp_us: [1.0, 1.2],
            load_max: 0.80,
            wire_load_max: [0.80, 0.81],
            cpu_load: 0.046,
            board_cpu_load: 0.05,
            answers: 100,
            wire_answers: 102,
            frame: 0.055,
            ..Own::default()
        }
    }

    #[test]
    fn what_agrees_is_no_complaint() {
        assert_eq!(own().complaints(), Vec::<String>::new());
    }

    #[test]
    fn what_differs_is_told() {
        for (wrong, words) in [
            (
                Own {
                    jitter_pp_us: 2.3,
                    ..own()
                },
                "SYNC jitter",
            ),
            (
                Own {
                    jitter_pp_us: -0.1,
                    ..own()
                },
                "SYNC jitter",
            ),
            (
                Own {
                    load_max: 0.87,
                    ..own()
                },
                "bus load",
            ),
            (
                Own {
                    cpu_load: 0.039,
                    ..own()
                },
                "CPU load",
            ),
            (
                Own {
                    answers: 90,
                    ..own()
                },
                "102",
            ),
            (
                Own {
                    overruns: 1,
                    ..own()
                },
                "overruns",
            ),
            (
                Own {
                    syncs_not_sent: 2,
                    ..own()
                },
                "SYNCs not sent",
            ),
        ] {
            let complaints = wrong.complaints();
            assert_eq!(complaints.len(), 1, "{complaints:?}");
            assert!(complaints[0].contains(words), "{complaints:?}");
        }
    }
}
