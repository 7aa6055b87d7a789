//! The runs of a campaign.

use std::time::Instant;

use canmaster_sim::board::irqs;
use canmaster_sim::judge::{Outcome, worst_pair};
use canmaster_sim::time::Time;
use canmaster_sim::world::{Image, Record, Scenario, World, trials};
use serde::Serialize;

use crate::bench::realtime::{self, Case};
use crate::networks::{self, Variant};

/// The interrupts whose tasks are made to hang, in turn.
const HANGS: [u8; 5] = [
    irqs::FDCAN1_IT0,
    irqs::TIM2,
    irqs::TIM3,
    irqs::TIM7,
    irqs::UART4,
];
/// How long the board is held in reset, in turn, milliseconds.
const RESETS_MS: [u64; 8] = [1, 5, 20, 100, 250, 500, 1000, 2000];
/// How long the axes have been in motion by then, in turn, milliseconds.
const AFTER_MS: [u64; 3] = [0, 130, 700];

/// One run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Job {
    seed: u64,
    kind: Kind,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// Round trips, for so long.
    Run { end: Time },
    /// The board is held in reset in motion.
    Reset { after: Time, held: Time },
    /// A task hangs in motion, and the watchdog bites.
    Hang { irq: u8 },
}

/// What came out of one.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Row {
    pub(super) seed: u64,
    pub(super) kind: String,
    pub(super) ok: bool,
    pub(super) reason: String,
    pub(super) wall_s: f64,
    #[serde(flatten)]
    pub(super) figures: Option<Figures>,
    #[serde(skip_serializing_if = "Option::is_none")]
    real_time: Option<realtime::Figures>,
}

/// What is measured in a run without disturbance.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Figures {
    pub(super) arrivals: usize,
    pub(super) error_max: i64,
    pub(super) pair_max_ms: f64,
    pub(super) missed: usize,
    pub(super) overruns: u64,
    pub(super) jitter_pp_us: f64,
    pub(super) load_max: f64,
    pub(super) cpu_load_mean: f64,
    pub(super) sync_isr_worst_cycles: u64,
    pub(super) irq_off_max_cycles: u64,
    pub(super) stack_high_water_bytes: u32,
    pub(super) times_real_time: f64,
}

impl Job {
    /// What is done with one seed.
    pub(super) fn all(seed: u64, end: Time) -> [Job; 3] {
        let turn = seed as usize;
        let held = Time::from_ms(RESETS_MS[turn % RESETS_MS.len()]);
        let after = Time::from_ms(AFTER_MS[turn % AFTER_MS.len()]);
        let irq = HANGS[turn % HANGS.len()];
        [
            Kind::Run { end },
            Kind::Reset { after, held },
            Kind::Hang { irq },
        ]
        .map(|kind| Job { seed, kind })
    }

    fn name(&self) -> String {
        match self.kind {
            Kind::Run { end } => format!("run of {:.0} s", end.as_secs_f64()),
            Kind::Reset { held, .. } => format!("reset for {} ms", held.as_ms()),
            Kind::Hang { irq } => format!("interrupt {irq} hangs"),
        }
    }

    /// Does it.
    pub(super) fn run(&self, image: &Image) -> Row {
        let started = Instant::now();
        let mut figures = None;
        let outcome = match self.kind {
            Kind::Run { end } => self.undisturbed(image, end, &mut figures),
            Kind::Reset { after, held } => {
                trials::reset_in_motion(image, self.seed, after, held).map_err(words)
            }
            Kind::Hang { irq } => trials::hang_in_motion(image, self.seed, irq).map_err(words),
        };
        Row {
            seed: self.seed,
            kind: self.name(),
            ok: outcome.is_ok(),
            reason: outcome.err().unwrap_or_default(),
            wall_s: started.elapsed().as_secs_f64(),
            figures,
            real_time: None,
        }
    }

    fn undisturbed(
        &self,
        image: &Image,
        end: Time,
        figures: &mut Option<Figures>,
    ) -> Result<(), String> {
        let started = Instant::now();
        let world = World::new(image, Scenario::new(self.seed, end)).map_err(words)?;
        let record = world.run(&mut ());
        let wall_s = started.elapsed().as_secs_f64();
        let measured = Figures::of(&record, wall_s);
        let speed = measured.times_real_time;
        *figures = Some(measured);
        match record.verdict.outcome {
            Outcome::Ok if speed < 1.0 => Err(format!(
                "the emulation was slower than real time: {speed:.2} times"
            )),
            Outcome::Ok => Ok(()),
            outcome => Err(format!("{outcome}: {}", record.verdict.reason)),
        }
    }
}

impl Figures {
    fn of(record: &Record, wall_s: f64) -> Figures {
        let apart = worst_pair(&record.arrivals).map_or(Time::ZERO, |(apart, ..)| apart);
        Figures {
            arrivals: record.arrivals.len(),
            error_max: record
                .arrivals
                .iter()
                .map(|arrival| arrival.error)
                .max()
                .unwrap_or(0),
            pair_max_ms: apart.as_us_f64() / 1000.0,
            missed: record.bus.missed,
            overruns: record.board.rx_overruns.iter().sum(),
            jitter_pp_us: record.bus.jitter_pp_us,
            load_max: record.bus.load_max,
            cpu_load_mean: record.board.cpu_load(),
            sync_isr_worst_cycles: record
                .board
                .irq(irqs::TIM2)
                .map_or(0, |irq| irq.worst_cycles),
            irq_off_max_cycles: record.board.irq_off_max_cycles,
            stack_high_water_bytes: record.board.stack_high_water_bytes,
            times_real_time: record.simulated.as_secs_f64() / wall_s.max(f64::MIN_POSITIVE),
        }
    }
}

impl Row {
    /// Builds a machine of its own, and lets it make a round trip.
    pub(super) fn of(variant: Variant) -> Row {
        const SEED: u64 = 1;
        let started = Instant::now();
        let mut figures = None;
        let outcome = variant.build().and_then(|built| {
            let started = Instant::now();
            let record = variant.run(&built.image, SEED)?;
            figures = Some(Figures::of(&record, started.elapsed().as_secs_f64()));
            networks::good(&record)
        });
        Row {
            seed: SEED,
            kind: variant.name(),
            ok: outcome.is_ok(),
            reason: outcome.err().map(|e| format!("{e:#}")).unwrap_or_default(),
            wall_s: started.elapsed().as_secs_f64(),
            figures,
            real_time: None,
        }
    }

    /// A bench, and the limits that it missed.
    pub(super) fn of_bench(name: &str, seed: u64, missed: &[String], wall_s: f64) -> Row {
        Row {
            seed,
            kind: name.to_string(),
            ok: missed.is_empty(),
            reason: missed.join("; "),
            wall_s,
            figures: None,
            real_time: None,
        }
    }

    /// A scenario of `bench realtime` with all seeds.
    pub(super) fn real_time(
        case: &'static Case,
        seeds: u64,
        runs: Vec<Result<realtime::Figures, String>>,
        wall_s: f64,
    ) -> Row {
        let mut missed = Vec::new();
        let mut real_time: Option<realtime::Figures> = None;
        for run in runs {
            match (run, real_time.take()) {
                (Ok(figures), None) => real_time = Some(figures),
                (Ok(figures), Some(all)) => real_time = Some(all.and(figures)),
                (Err(words), all) => {
                    missed.push(words);
                    real_time = all;
                }
            }
        }
        missed.extend(real_time.iter().flat_map(|all| all.missed_limits(case)));
        let row = Row {
            seed: seeds,
            kind: case.name.to_string(),
            ok: missed.is_empty(),
            reason: missed.join("; "),
            wall_s,
            figures: None,
            real_time,
        };
        if !row.ok {
            eprintln!("{}: {}", row.kind, row.reason);
        }
        row
    }

    /// What stands over the columns of [`cells`](Self::cells).
    pub(super) const HEADING: [&str; 10] = [
        "seed",
        "run",
        "result",
        "arrivals",
        "error",
        "pair [ms]",
        "missed",
        "overruns",
        "jitter [us]",
        "x real time",
    ];

    /// For the table.
    pub(super) fn cells(&self) -> Vec<String> {
        let mut cells = vec![
            self.seed.to_string(),
            self.kind.clone(),
            if self.ok {
                "ok".into()
            } else {
                "failed".into()
            },
        ];
        if let Some(figures) = &self.figures {
            cells.extend([
                figures.arrivals.to_string(),
                figures.error_max.to_string(),
                format!("{:.1}", figures.pair_max_ms),
                figures.missed.to_string(),
                figures.overruns.to_string(),
                format!("{:.2}", figures.jitter_pp_us),
                format!("{:.1}", figures.times_real_time),
            ]);
        }
        cells
    }
}

fn words(error: impl ToString) -> String {
    error.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bench_that_misses_a_limit_fails_the_campaign() {
        assert!(Row::of_bench("bench cycle", 1, &[], 1.0).ok);
        let row = Row::of_bench("bench cycle", 1, &["too far".to_string()], 1.0);
        assert_eq!((row.ok, row.reason.as_str()), (false, "too far"));
    }

    #[test]
    fn twenty_seeds_cover_every_reset_and_every_hang() {
        let jobs: Vec<Job> = (1..=20)
            .flat_map(|seed| Job::all(seed, Time::from_s(60)))
            .collect();
        for ms in RESETS_MS {
            let held_so = |job: &Job| matches!(job.kind, Kind::Reset { held, .. } if held == Time::from_ms(ms));
            assert!(jobs.iter().any(held_so), "{ms}");
        }
        for hung in HANGS {
            assert!(
                jobs.iter().any(|job| job.kind == Kind::Hang { irq: hung }),
                "{hung}"
            );
        }
    }
}
