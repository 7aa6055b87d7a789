//! A real board, through probe-rs.

use std::path::Path;
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail};

use crate::cargo;
use crate::cli::MachineOptions;
use crate::machine::Checked;

/// The board's chip as probe-rs calls it.
const CHIP: &str = "STM32G474RETx";

const INSTALL: &str = "probe-rs is not installed. Install it with one of

    cargo install probe-rs-tools --locked
    curl -LsSf https://github.com/probe-rs/probe-rs/releases/latest/download/probe-rs-tools-installer.sh | sh

and, on Linux, its udev rules: https://probe.rs/docs/getting-started/probe-setup/";

/// `cargo xtask flash`: write the image, start it, show its log.
pub(crate) fn flash(options: &MachineOptions) -> Result<ExitCode> {
    probe_rs("run", options)
}

/// `cargo xtask attach`: show the log of a running board, which goes on
/// undisturbed. It has to be told the machine that the board was built for: where
/// the log lies, and its strings, are in the image.
pub(crate) fn attach(options: &MachineOptions) -> Result<ExitCode> {
    probe_rs("attach", options)
}

fn probe_rs(subcommand: &str, options: &MachineOptions) -> Result<ExitCode> {
    let checked = Checked::read(options.network.as_deref())?;
    // Nobody wants to wait for a build to be told this.
    if Command::new("probe-rs").arg("--version").output().is_err() {
        bail!("{INSTALL}");
    }
    let elf = checked.build()?;
    let mut command = arguments(subcommand, &elf);
    let status = command
        .status()
        .with_context(|| format!("cannot start `{}`", cargo::line(&command)))?;
    if !status.success() {
        bail!(
            "`{}` ended with {status}. Is the board connected by its ST-LINK USB socket, and no \
             other debugger attached?",
            cargo::line(&command)
        );
    }
    Ok(ExitCode::SUCCESS)
}

fn arguments(subcommand: &str, elf: &Path) -> Command {
    let mut command = Command::new("probe-rs");
    command.arg(subcommand).args(["--chip", CHIP]).arg(elf);
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chip_is_named() {
        assert_eq!(
            cargo::line(&arguments("run", Path::new("canmaster"))),
            "probe-rs run --chip STM32G474RETx canmaster"
        );
    }
}
