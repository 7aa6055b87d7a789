//! The firmware image: what is flashed and what is booted here.

use std::path::Path;

use super::machine::{self, Machine};
use crate::log::{LogError, LogTable};

/// An ELF file with the strings of its log, and the machine that it is built for.
pub struct Image {
    elf: Vec<u8>,
    table: LogTable,
    machine: Machine,
}

/// An image cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageError {
    /// The file cannot be read.
    #[error("cannot read {path}: {source}; build the firmware with `cargo xtask build`")]
    Read {
        /// Which file.
        path: String,
        /// Why.
        source: std::io::Error,
    },
    /// It cannot be logged from.
    #[error(transparent)]
    Log(#[from] LogError),
}

impl Image {
    /// An image for the sample machine from the bytes of its ELF file.
    pub fn new(elf: Vec<u8>) -> Result<Image, ImageError> {
        let table = LogTable::new(&elf)?;
        let machine = machine::sample().clone();
        Ok(Image {
            elf,
            table,
            machine,
        })
    }

    /// An image for the sample machine from its ELF file.
    pub fn read(path: &Path) -> Result<Image, ImageError> {
        let elf = std::fs::read(path).map_err(|source| ImageError::Read {
            path: path.display().to_string(),
            source,
        })?;
        Image::new(elf)
    }

    /// The same, built for another machine.
    pub fn built_for(self, machine: Machine) -> Image {
        Image { machine, ..self }
    }

    /// The machine that it is built for.
    pub fn machine(&self) -> &Machine {
        &self.machine
    }

    /// The ELF file.
    pub fn elf(&self) -> &[u8] {
        &self.elf
    }

    /// The strings of its log.
    pub fn log_table(&self) -> &LogTable {
        &self.table
    }
}
