//! What can be typed.

use std::path::PathBuf;

use canmaster::NodeId;
use canmaster_sim::log::Level;
use clap::{Args, CommandFactory, Parser, Subcommand, ValueEnum};

use crate::run::fault::Fault;

/// The longest run that can be asked for: an hour of virtual time.
pub(crate) const LONGEST_RUN_S: f64 = 3600.0;

#[derive(Parser)]
#[command(
    name = "cargo xtask",
    bin_name = "cargo xtask",
    about = "Build, run, test and flash canmaster",
    disable_version_flag = true
)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) command: Command,
}

impl Cli {
    /// Reads the command line. Whatever is wrong with it ends the program with
    /// usage and exit code 2; help is printed with exit code 0.
    pub(crate) fn parse_or_exit() -> Cli {
        Cli::try_parse().unwrap_or_else(|error| {
            let words = error.render();
            if error.use_stderr() && !words.to_string().contains("Usage") {
                // Of a bad value clap says only what is wrong with it.
                eprintln!("{words}\n{}", usage());
                std::process::exit(error.exit_code());
            }
            error.exit()
        })
    }
}

/// Ends the program as if the command line had been found wrong when it was read.
pub(crate) fn refuse(words: &str) -> ! {
    eprintln!("error: {words}\n\n{}", usage());
    std::process::exit(USAGE)
}

/// Exit code of a command line that is wrong.
const USAGE: i32 = 2;

/// Usage of the command that was typed.
fn usage() -> clap::builder::StyledStr {
    let mut all = Cli::command();
    all.build();
    let typed = std::env::args().nth(1).unwrap_or_default();
    match all.find_subcommand_mut(&typed) {
        Some(command) => command.render_usage(),
        None => all.render_usage(),
    }
}

#[derive(Subcommand)]
pub(crate) enum Command {
    /// Build the firmware, boot it on the emulated board, move the motors
    Run(RunOptions),
    /// Build the firmware and run all tests
    Test(TestOptions),
    /// Build the firmware image
    Build(MachineOptions),
    /// Flash and RAM of the image, section by section, against the budget
    Size(SizeOptions),
    /// Write the image to a board with probe-rs and show its log
    Flash(MachineOptions),
    /// Show the log of a board that is running already
    Attach(MachineOptions),
    /// Check the description of the machine and lay out its cycle
    Check(CheckOptions),
    /// Start a machine of your own from the sample
    New(NewOptions),
    /// How many nodes can be updated in 0.1 s, by SDO and by PDO
    Capacity(CapacityOptions),
    /// The tests with CANopen tools that are not ours: wants Python 3
    Interop,
    /// Everything that has to pass: format, lints, tests, sizes, a run, other
    /// tools, docs
    Ci(CiOptions),
    /// The long figures: many seeds of 60 simulated seconds each
    Campaign(CampaignOptions),
    /// Figures that the image has to reach, one bench each
    Bench(BenchOptions),
}

#[derive(Args, Clone, Debug)]
pub(crate) struct MachineOptions {
    /// Description of the machine, checked first [default: network.toml of this
    /// project]
    #[arg(long, value_name = "FILE")]
    pub(crate) network: Option<PathBuf>,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct RunOptions {
    #[command(flatten)]
    pub(crate) machine: MachineOptions,
    /// Motion program, compiled and downloaded to the running board before the
    /// release [default: the one that is built into the image]
    #[arg(long, value_name = "FILE", conflicts_with = "bridge")]
    pub(crate) program: Option<PathBuf>,
    /// Simulated seconds from power-on; the program repeats whole round trips
    /// that fit [default: enough for one]
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub(crate) seconds: Option<f64>,
    /// Seed of everything that is drawn at random
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Leave this drive off the bus; may be repeated
    #[arg(long, value_name = "NODE", value_parser = node)]
    pub(crate) without: Vec<NodeId>,
    /// The drives come from the factory: none has a node-ID; the firmware finds
    /// them by serial number and gives them theirs
    #[arg(long)]
    pub(crate) factory: bool,
    /// One more drive without node-ID, which the network does not name
    #[arg(long)]
    pub(crate) stranger: bool,
    /// Give a drive a fault: NODE:identity, NODE:refuse=INDEX:SUB (hex),
    /// NODE:forgetful (stores nothing), NODE:silent (in motion); may be repeated
    #[arg(long, value_name = "FAULT")]
    pub(crate) fault: Vec<Fault>,
    /// Never run ahead of the clock on the wall
    #[arg(long)]
    pub(crate) realtime: bool,
    /// Let other CANopen tools onto the bus: a server on this computer that
    /// speaks slcan (0: any free port; the address is printed). Paced by the
    /// clock; without --seconds until Ctrl-C
    #[arg(long, value_name = "PORT")]
    pub(crate) bridge: Option<u16>,
    /// Nobody presses the board's button: a tool on the bridge commands the group
    #[arg(long, requires = "bridge")]
    pub(crate) unattended: bool,
    /// Least severe log lines of the firmware that are shown
    #[arg(long, value_name = "LEVEL", default_value = "info")]
    pub(crate) log: LogLevel,
    /// Also write position and velocity of all axes as an SVG picture
    #[arg(long, value_name = "FILE")]
    pub(crate) picture: Option<PathBuf>,
    /// One JSON object on standard output and nothing else there
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct TestOptions {
    /// Passed on to `cargo test`, for example the name of a test
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    pub(crate) args: Vec<String>,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct CiOptions {
    /// Leave the tests out: they have run already
    #[arg(long)]
    pub(crate) no_tests: bool,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct SizeOptions {
    #[command(flatten)]
    pub(crate) machine: MachineOptions,
    /// One JSON object on standard output and nothing else there
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct CheckOptions {
    /// The description [default: network.toml of this project]
    #[arg(value_name = "FILE")]
    pub(crate) file: Option<PathBuf>,
    /// One JSON object on standard output and nothing else there
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct NewOptions {
    /// The folder to make
    #[arg(value_name = "DIR")]
    pub(crate) dir: PathBuf,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct CapacityOptions {
    /// Also find it out with simulated drives on the bit-timed bus
    #[arg(long)]
    pub(crate) measure: bool,
    /// One JSON object on standard output and nothing else there
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct CampaignOptions {
    /// How many seeds, from 1 on [default: 20; with --faults 200]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub(crate) seeds: Option<u64>,
    /// Simulated seconds of each
    #[arg(long, value_name = "S", default_value = "60", value_parser = seconds)]
    pub(crate) seconds: f64,
    /// Instead: a random fault at a random moment with each seed, judged by the
    /// contract for faults
    #[arg(long, conflicts_with = "seconds")]
    pub(crate) faults: bool,
    /// Runs at the same time [default: one per core]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..=1024))]
    pub(crate) jobs: Option<u64>,
    /// One JSON object on standard output and nothing else there
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Clone, Debug)]
pub(crate) struct BenchOptions {
    /// Which figures
    #[arg(value_enum)]
    pub(crate) bench: Bench,
    /// Seed of everything that is drawn at random
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Of `realtime`: only this scenario [default: all of them]
    #[arg(long, value_name = "NAME")]
    pub(crate) scenario: Option<String>,
    /// Of `realtime`, `cycle` and `self-measurement`: simulated seconds of motion that
    /// are looked at [default: 30, 3 and 3]
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub(crate) seconds: Option<f64>,
    /// Of `realtime`: how many seeds, from --seed on
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=1000))]
    pub(crate) seeds: u64,
    /// Of `instructions`: write the limits anew, a tenth above what is counted
    #[arg(long)]
    pub(crate) accept: bool,
    /// Of `cycle`: put table and plot into docs/performance.md
    #[arg(long)]
    pub(crate) document: bool,
    /// One JSON object on standard output and nothing else there
    #[arg(long)]
    pub(crate) json: bool,
}

/// What can be measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Bench {
    /// How long the configuration of all drives takes
    Startup,
    /// How fast data goes to and from a drive by SDO
    Sdo,
    /// How many cycles the steps of the axes take, in each mode
    Motion,
    /// Whether the cycle holds at 2 ms and 1 ms, and how even the SYNC is
    Realtime,
    /// How many instructions the hot functions take: wants Valgrind
    Instructions,
    /// The smallest cycle that holds for 1 .. 12 axes on one bus
    Cycle,
    /// Both orders of the RPDOs, and both ways to find out that a drive is lost
    Choices,
    /// What it costs the board to measure itself
    SelfMeasurement,
}

/// Severities as they are typed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum LogLevel {
    /// Nothing at all
    Off,
    Error,
    Warn,
    Info,
    Debug,
    Trace,
}

impl LogLevel {
    /// Whether a line of `level` is to be shown. Lines without a level
    /// (`defmt::println!`) are shown unless the log is off.
    pub(crate) fn shows(self, level: Option<Level>) -> bool {
        let least = match self {
            LogLevel::Off => return false,
            LogLevel::Error => Level::Error,
            LogLevel::Warn => Level::Warn,
            LogLevel::Info => Level::Info,
            LogLevel::Debug => Level::Debug,
            LogLevel::Trace => Level::Trace,
        };
        level.is_none_or(|level| level >= least)
    }
}

fn seconds(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "not a number".to_string())?;
    // Written so that NaN fails as well.
    if value > 0.0 && value <= LONGEST_RUN_S {
        Ok(value)
    } else {
        Err(format!("must be above 0 and at most {LONGEST_RUN_S}"))
    }
}

/// A node-ID.
pub(crate) fn node(text: &str) -> Result<NodeId, String> {
    let id = text.parse().ok().and_then(NodeId::new);
    id.ok_or_else(|| "not a node-ID: these are 1 .. 127".to_string())
}

/// Where the results of a run go, relative to the workspace.
pub(crate) fn results_dir() -> PathBuf {
    crate::cargo::workspace().join("target").join("run")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn numbers_are_checked() {
        for bad in ["0", "-1", "nan", "inf", "3601", "ten", ""] {
            assert!(seconds(bad).is_err(), "{bad}");
        }
        assert_eq!(seconds("0.5"), Ok(0.5));
        for bad in ["0", "128", "x", "-3"] {
            assert!(node(bad).is_err(), "{bad}");
        }
        assert_eq!(node("3"), Ok(NodeId::constant::<3>()));
    }

    #[test]
    fn levels_filter() {
        assert!(LogLevel::Info.shows(Some(Level::Error)));
        assert!(!LogLevel::Info.shows(Some(Level::Debug)));
        assert!(!LogLevel::Off.shows(None));
    }
}
