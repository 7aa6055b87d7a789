//! `cargo xtask test` and `cargo xtask ci`.

use std::process::ExitCode;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};

use crate::cli::{
    Bench, BenchOptions, CiOptions, LogLevel, MachineOptions, RunOptions, TestOptions,
};
use crate::image::{Budget, ImageSize};
use crate::machine::Checked;
use crate::{bench, cargo, conformance, firmware, interop, networks, run, size, toolchain};

/// A name and what is done.
type Step = (&'static str, fn() -> Result<()>);

/// The crate that exists for the target only.
const BOARD_CRATE: &str = "nucleo-g474re";

/// What `test` and `ci` look at of each scenario of `bench realtime`, seconds.
const REALTIME_S: f64 = 3.0;

/// Name of the step that runs them.
const TESTS: &str = "tests";

/// `cargo xtask test`: the image, then every test of the workspace.
pub(crate) fn test(options: &TestOptions) -> Result<ExitCode> {
    tests(&options.args)?;
    if options.args.is_empty() {
        networks::four()?;
        real_time()?;
    }
    Ok(ExitCode::SUCCESS)
}

fn tests(args: &[String]) -> Result<()> {
    let image = firmware::build()?;
    let unhurried = Checked::read(Some(&cargo::workspace().join(networks::UNHURRIED)))?.build()?;
    // The library's `defmt` feature is off: with it, and DEFMT_LOG set, tests
    // do not link on the host. `ci` checks it by clippy instead.
    cargo::run(
        cargo::cargo()
            .args(["test", "--workspace", "--profile", "host", "--locked"])
            .args(args)
            .env(firmware::IMAGE_VARIABLE, image)
            .env(firmware::IMAGE_10_MS_VARIABLE, unhurried),
    )
}

/// `cargo xtask ci`: everything that has to pass, in the order of how soon it
/// fails.
pub(crate) fn command(options: &CiOptions) -> Result<ExitCode> {
    let steps: [Step; 15] = [
        ("format", format),
        ("lints, host", lints_host),
        ("lints, board", lints_target),
        (TESTS, || tests(&[])),
        ("networks", networks::four),
        ("sizes", sizes),
        ("one run", one_run),
        ("bench startup", || benched(Bench::Startup)),
        ("bench sdo", || benched(Bench::Sdo)),
        ("bench motion", || benched(Bench::Motion)),
        ("bench realtime", real_time),
        ("bench instructions", instructions),
        ("other tools", interop::tests),
        ("documentation", documentation),
        ("conformance table", conformance::check),
    ];
    let mut passed: Vec<(&str, Duration)> = Vec::new();
    for (name, step) in steps {
        if options.no_tests && name == TESTS {
            continue;
        }
        eprintln!("\n== {name}");
        let started = Instant::now();
        step().with_context(|| format!("step `{name}`"))?;
        passed.push((name, started.elapsed()));
    }
    println!();
    for (name, took) in &passed {
        println!("passed  {name:<16} {:7.1} s", took.as_secs_f64());
    }
    let total: Duration = passed.iter().map(|(_, took)| *took).sum();
    println!(
        "passed  all {} steps   {:7.1} s",
        passed.len(),
        total.as_secs_f64()
    );
    Ok(ExitCode::SUCCESS)
}

fn format() -> Result<()> {
    cargo::run(cargo::cargo().args(["fmt", "--all", "--check"]))
}

fn lints_host() -> Result<()> {
    cargo::run(
        cargo::cargo()
            .args(["clippy", "--workspace", "--all-targets", "--all-features"])
            .args(["--profile", "host", "--locked", "--", "-D", "warnings"]),
    )
}

fn lints_target() -> Result<()> {
    toolchain::ensure_target()?;
    cargo::run(firmware::cargo_for_target("clippy").args(["--", "-D", "warnings"]))
}

fn sizes() -> Result<()> {
    let image = ImageSize::read(&firmware::build()?)?;
    let budget = Budget::read()?;
    eprintln!("{}", size::as_table(&image, budget));
    let exceeded = budget.exceeded_by(&image);
    if !exceeded.is_empty() {
        bail!("{} ({})", exceeded.join("; "), Budget::FILE);
    }
    Ok(())
}

fn one_run() -> Result<()> {
    let options = RunOptions {
        machine: MachineOptions { network: None },
        program: None,
        factory: false,
        stranger: false,
        seconds: None,
        seed: 1,
        without: Vec::new(),
        fault: Vec::new(),
        realtime: false,
        bridge: None,
        unattended: false,
        log: LogLevel::Info,
        picture: None,
        json: false,
    };
    if run::command(&options)? != ExitCode::SUCCESS {
        bail!("not every move of every drive arrived");
    }
    Ok(())
}

/// Where there is no Valgrind, that is said, and nothing is counted.
fn instructions() -> Result<()> {
    if !bench::instructions::is_possible() {
        eprintln!("left out: {}", bench::instructions::MISSING);
        return Ok(());
    }
    benched(Bench::Instructions)
}

fn real_time() -> Result<()> {
    benched(Bench::Realtime)
}

fn benched(bench: Bench) -> Result<()> {
    let options = BenchOptions {
        bench,
        seed: 1,
        scenario: None,
        seconds: Some(REALTIME_S),
        seeds: 1,
        accept: false,
        document: false,
        json: false,
    };
    if bench::command(&options)? != ExitCode::SUCCESS {
        bail!("a limit was missed");
    }
    Ok(())
}

fn documentation() -> Result<()> {
    let mut host = cargo::cargo();
    host.args(["doc", "--workspace", "--exclude", BOARD_CRATE])
        .args(["--no-deps", "--profile", "host", "--locked"]);
    // There is nothing of it on the host.
    let mut board = cargo::cargo();
    board
        .args([
            "doc",
            "--package",
            BOARD_CRATE,
            "--target",
            toolchain::TARGET,
        ])
        .args(["--no-deps", "--release", "--locked"]);
    for command in [&mut host, &mut board] {
        cargo::run(command.env("RUSTDOCFLAGS", "-D warnings"))?;
    }
    Ok(())
}
