//! `cargo xtask interop`: other people's CANopen tools on the simulated bus.

use std::process::{Command, ExitCode, Stdio};

use anyhow::{Context, Result};

use crate::cargo;
use crate::machine::Checked;
use crate::networks::UNHURRIED;

/// What Python is called, on one system or another.
const NAMES: [&str; 2] = ["python3", "python"];
/// Makes the environment and runs the tests.
const TESTS: &str = "tests/interop/run.py";
/// Where the tests find this program.
const PROGRAM_VARIABLE: &str = "CANMASTER_XTASK";

/// `cargo xtask interop`.
pub(crate) fn command() -> Result<ExitCode> {
    tests()?;
    Ok(ExitCode::SUCCESS)
}

/// Builds the firmware and runs the tests against it.
pub(crate) fn tests() -> Result<()> {
    // The tests start machines, one after the other, which are built by then.
    Checked::read(Some(&cargo::workspace().join(UNHURRIED)))?.build()?;
    let program = std::env::current_exe().context("this program does not know its own name")?;
    let mut command = Command::new(python()?);
    command
        .arg(TESTS)
        .current_dir(cargo::workspace())
        .env(PROGRAM_VARIABLE, program);
    cargo::run(&mut command)
}

/// The first name under which there is a Python 3.
fn python() -> Result<&'static str> {
    let is_three = |name: &&str| {
        Command::new(name)
            .args([
                "-c",
                "import sys, venv; sys.exit(sys.version_info < (3, 9))",
            ])
            .stdin(Stdio::null())
            .stderr(Stdio::null())
            .status()
            .is_ok_and(|status| status.success())
    };
    NAMES.into_iter().find(is_three).context(
        "these tests want Python 3.9 or later with its venv module (Debian: apt install \
         python3-venv), and there is none in PATH",
    )
}
