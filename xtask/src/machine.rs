//! The machine that a command is about: described, checked, and the image that is
//! built for it.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use canmaster_network::program::{self, Program};
use canmaster_network::{Severity, load, model};
use canmaster_sim::world::{Image, Machine};

use crate::{cargo, firmware};

/// The description of this project.
pub(crate) const DESCRIPTION: &str = "network.toml";

/// A description without errors.
pub(crate) struct Description {
    /// As the user names it.
    pub(crate) path: PathBuf,
    /// What it describes.
    pub(crate) machine: model::Machine,
    pub(crate) warnings: usize,
}

impl Description {
    /// Checks the description in `file`; without, that of the project. What is
    /// wrong is said on standard error.
    ///
    /// # Errors
    /// If it is refused: where, and how many errors there are.
    pub(crate) fn check(file: Option<&Path>) -> Result<Description> {
        let path = match file {
            Some(file) => file.to_path_buf(),
            None => of_project(),
        };
        let outcome = load(&path);
        for problem in &outcome.problems {
            eprintln!("{problem}\n");
        }
        let is_error = |problem: &&canmaster_network::Problem| problem.severity == Severity::Error;
        let errors = outcome.problems.iter().filter(is_error).count();
        let Some(machine) = outcome.machine else {
            bail!("{}: refused, {}", path.display(), counted(errors, "error"));
        };
        let warnings = outcome.problems.len() - errors;
        Ok(Description {
            path,
            machine,
            warnings,
        })
    }
}

/// The description of the project, as a user in the project's folder names it.
fn of_project() -> PathBuf {
    let path = cargo::workspace().join(DESCRIPTION);
    let here = std::env::current_dir().ok();
    let near = here.and_then(|here| path.strip_prefix(here).ok().map(PathBuf::from));
    near.unwrap_or(path)
}

/// How many there are of something.
pub(crate) fn counted(number: usize, what: &str) -> String {
    let plural = if number == 1 { "" } else { "s" };
    format!("{number} {what}{plural}")
}

/// A machine that can be built for and simulated.
pub(crate) struct Checked {
    /// `None`: that of the project.
    path: Option<PathBuf>,
    pub(crate) machine: Machine,
    /// Its buses with their cycles laid out.
    pub(crate) buses: Vec<model::Bus>,
}

impl Checked {
    /// Checks the description in `file`; without, that of the project. What is
    /// wrong is said on standard error.
    pub(crate) fn read(file: Option<&Path>) -> Result<Checked> {
        Checked::of(file, Description::check(file)?.machine)
    }

    /// The same, but its axes run the program in `program`, which is compiled for
    /// them.
    ///
    /// # Errors
    /// As above, and what is wrong with the program.
    pub(crate) fn with_program(file: Option<&Path>, program: &Path) -> Result<(Checked, Program)> {
        let mut described = Description::check(file)?.machine;
        let outcome = program::load(program, &described);
        for problem in &outcome.problems {
            eprintln!("{problem}\n");
        }
        let is_error = |problem: &&canmaster_network::Problem| problem.severity == Severity::Error;
        let errors = outcome.problems.iter().filter(is_error).count();
        let Some(compiled) = outcome.program else {
            bail!(
                "{}: refused, {}",
                program.display(),
                counted(errors, "error")
            );
        };
        described.program = Some(compiled.clone());
        Ok((Checked::of(file, described)?, compiled))
    }

    fn of(file: Option<&Path>, described: model::Machine) -> Result<Checked> {
        let path = match file {
            Some(file) => Some(std::path::absolute(file).context("no current folder")?),
            None => None,
        };
        let machine = Machine::new(&described)?;
        Ok(Checked {
            path,
            machine,
            buses: described.buses,
        })
    }

    /// The axes that the firmware leads.
    pub(crate) fn axes(&self) -> usize {
        self.machine.network().nodes.len()
    }

    /// Builds the firmware for it and says where it is.
    pub(crate) fn build(&self) -> Result<PathBuf> {
        match &self.path {
            Some(path) => firmware::build_for(path),
            None => firmware::build(),
        }
    }

    /// Builds the firmware for it without its measuring of itself, to be run.
    pub(crate) fn built_unmeasured(&self) -> Result<Image> {
        let path = self.path.as_deref();
        let path = path.map_or_else(|| cargo::workspace().join(DESCRIPTION), Path::to_path_buf);
        self.image(&firmware::build_unmeasured_for(&path)?)
    }

    /// An image that was built for it.
    pub(crate) fn image(&self, elf: &Path) -> Result<Image> {
        let image = Image::read(elf).context("the firmware image cannot be run")?;
        Ok(image.built_for(self.machine.clone()))
    }

    /// Builds the firmware for it, to be run.
    pub(crate) fn built(&self) -> Result<Image> {
        eprintln!("Building the firmware.");
        self.image(&self.build()?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_not_many() {
        assert_eq!(counted(0, "error"), "0 errors");
        assert_eq!(counted(1, "error"), "1 error");
        assert_eq!(counted(12, "node"), "12 nodes");
    }
}
