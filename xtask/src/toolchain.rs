//! The compiler target of the board: found, or added.

use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

use crate::cargo;

/// NUCLEO-G474RE: Cortex-M4F.
pub(crate) const TARGET: &str = "thumbv7em-none-eabihf";

/// What to do where there is no rustup, or rustup has no network.
const FALL_BACK: &str = "Without rustup, a distribution's packages can build the image from the \
standard library's source. On Debian:

    apt install rustc-web cargo-web rust-web-src
    RUSTC_BOOTSTRAP=1 cargo build --locked --release --target thumbv7em-none-eabihf \\
        --bin canmaster --features defmt -Zbuild-std=core";

/// Makes sure that the target's `core` is installed, adding it with rustup
/// where it is not (rustup does that by itself only where automatic
/// installation is on).
pub(crate) fn ensure_target() -> Result<()> {
    if installed()? {
        return Ok(());
    }
    eprintln!("The Rust target {TARGET} is missing; adding it with rustup.");
    let added = cargo::status(
        Command::new("rustup")
            .args(["target", "add", TARGET])
            .current_dir(cargo::workspace()),
    );
    match added {
        Ok(status) if status.success() && installed()? => Ok(()),
        Ok(status) => bail!(
            "`rustup target add {TARGET}` ended with {status}, and the target is still missing. \
             Check the network and call it by hand.\n{FALL_BACK}"
        ),
        Err(error) => {
            bail!(
                "the Rust target {TARGET} is missing and rustup cannot add it: {error:#}\n{FALL_BACK}"
            )
        }
    }
}

/// Whether the compiler that cargo uses has `core` for the target.
fn installed() -> Result<bool> {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let output = Command::new(&rustc)
        .args(["--print", "target-libdir", "--target", TARGET])
        .current_dir(cargo::workspace())
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .with_context(|| format!("cannot start {}", rustc.to_string_lossy()))?;
    if !output.status.success() {
        return Ok(false);
    }
    let directory = String::from_utf8(output.stdout).context("rustc's answer is not UTF-8")?;
    let Ok(files) = std::fs::read_dir(directory.trim()) else {
        return Ok(false);
    };
    Ok(files
        .filter_map(Result::ok)
        .any(|file| file.file_name().to_string_lossy().starts_with("libcore-")))
}
