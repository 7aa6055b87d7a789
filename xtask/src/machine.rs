//! The machine that a command is about: described, checked, and the image that is
//! built for it.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use canmaster_network::{Severity, load};
use canmaster_sim::world::{Image, Machine};

use crate::check::DESCRIPTION;
use crate::{cargo, firmware};

/// A description without errors.
pub(crate) struct Checked {
    /// `None`: that of the project.
    path: Option<PathBuf>,
    /// What it describes.
    pub(crate) machine: Machine,
}

impl Checked {
    /// Checks the description in `file`; without, that of the project. What is
    /// wrong is said on standard error.
    pub(crate) fn read(file: Option<&Path>) -> Result<Checked> {
        let path = match file {
            Some(file) => Some(std::path::absolute(file).context("no current folder")?),
            None => None,
        };
        let shown = match file {
            Some(file) => file.to_path_buf(),
            None => cargo::workspace().join(DESCRIPTION),
        };
        let outcome = load(&shown);
        for problem in &outcome.problems {
            eprintln!("{problem}\n");
        }
        let Some(described) = outcome.machine else {
            let errors = outcome.problems.iter();
            let errors = errors.filter(|problem| problem.severity == Severity::Error);
            bail!("{}: refused, {} errors", shown.display(), errors.count());
        };
        let machine = Machine::new(&described)?;
        Ok(Checked { path, machine })
    }

    /// Builds the firmware for it.
    pub(crate) fn build(&self) -> Result<PathBuf> {
        match &self.path {
            Some(path) => firmware::build_for(path),
            None => firmware::build(),
        }
    }

    /// An image that was built for it.
    pub(crate) fn image(&self, elf: &Path) -> Result<Image> {
        let image = Image::read(elf).context("the firmware image cannot be run")?;
        Ok(image.built_for(self.machine.clone()))
    }
}
