//! `cargo xtask new`: a machine of the user's own, from the sample.

use std::fs;
use std::path::Path;
use std::process::ExitCode;

use anyhow::{Context, Result, bail};

use crate::cargo;
use crate::cli::NewOptions;
use crate::machine::DESCRIPTION;

/// What the sample is made of, relative to the workspace.
const FILES: [&str; 3] = [
    DESCRIPTION,
    "eds/maxon-epos4.eds",
    "docs/network.schema.json",
];

/// `cargo xtask new`.
pub(crate) fn command(options: &NewOptions) -> Result<ExitCode> {
    let description = options.dir.join(DESCRIPTION);
    if description.exists() {
        bail!(
            "{} exists already; name a new folder, or remove the file first",
            description.display()
        );
    }
    copy(&options.dir)?;
    println!(
        "{} is a machine like the sample. Change it, let it be checked, and run it with\n\n    \
         cargo xtask check {1}\n    \
         cargo xtask run --network {1}",
        options.dir.display(),
        description.display()
    );
    Ok(ExitCode::SUCCESS)
}

/// Copies the sample into a folder.
pub(crate) fn copy(dir: &Path) -> Result<()> {
    let workspace = cargo::workspace();
    for file in FILES {
        let to = dir.join(file);
        if let Some(folder) = to.parent() {
            fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
        }
        fs::copy(workspace.join(file), &to).with_context(|| to.display().to_string())?;
    }
    Ok(())
}
