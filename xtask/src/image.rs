//! What an image needs of the chip's memory, read from the ELF file.

use std::path::Path;

use anyhow::{Context, Result};
use object::{Object, ObjectSection, SectionFlags, SectionKind, elf};
use serde::{Deserialize, Serialize};

use crate::cargo;

/// One section of the image.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct Section {
    pub(crate) name: String,
    pub(crate) address: u64,
    pub(crate) flash_bytes: u64,
    pub(crate) ram_bytes: u64,
}

/// What an image needs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(crate) struct ImageSize {
    pub(crate) flash_bytes: u64,
    pub(crate) ram_bytes: u64,
    pub(crate) sections: Vec<Section>,
}

/// Axes of the sample.
const SAMPLE_AXES: usize = 6;

/// What an image may need: `firmware-budget.toml`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Budget {
    pub(crate) flash_bytes: u64,
    pub(crate) ram_bytes: u64,
    /// With twelve axes.
    pub(crate) ram_bytes_12_axes: u64,
}

impl ImageSize {
    /// Adds up the sections that occupy memory of the chip. A section with
    /// content lies in flash (that of .data as well: it is copied at start); a
    /// writable one occupies RAM.
    pub(crate) fn of(elf: &[u8]) -> Result<ImageSize> {
        let file = object::File::parse(elf).context("not an ELF file")?;
        let mut sections = Vec::new();
        for section in file.sections() {
            let SectionFlags::Elf { sh_flags } = section.flags() else {
                continue;
            };
            let allocated = sh_flags & u64::from(elf::SHF_ALLOC) != 0;
            if !allocated || section.size() == 0 {
                continue;
            }
            let writable = sh_flags & u64::from(elf::SHF_WRITE) != 0;
            let has_content = section.kind() != SectionKind::UninitializedData
                && section.file_range().is_some_and(|(_, size)| size > 0);
            sections.push(Section {
                name: section.name().unwrap_or("?").to_string(),
                address: section.address(),
                flash_bytes: if has_content { section.size() } else { 0 },
                ram_bytes: if writable { section.size() } else { 0 },
            });
        }
        Ok(ImageSize {
            flash_bytes: sections.iter().map(|section| section.flash_bytes).sum(),
            ram_bytes: sections.iter().map(|section| section.ram_bytes).sum(),
            sections,
        })
    }

    pub(crate) fn read(elf: &Path) -> Result<ImageSize> {
        let bytes = std::fs::read(elf).with_context(|| format!("cannot read {}", elf.display()))?;
        ImageSize::of(&bytes).with_context(|| format!("{}", elf.display()))
    }
}

impl Budget {
    /// Name of the file, in the root of the workspace.
    pub(crate) const FILE: &str = "firmware-budget.toml";

    pub(crate) fn read() -> Result<Budget> {
        let path = cargo::workspace().join(Budget::FILE);
        let text = std::fs::read_to_string(&path)
            .with_context(|| format!("cannot read {}", path.display()))?;
        toml::from_str(&text).with_context(|| format!("{}", path.display()))
    }

    /// The budget of a machine: with more axes than the sample, twelve or fewer,
    /// that of twelve.
    pub(crate) fn of(self, axes: usize) -> Budget {
        let ram_bytes = match axes {
            0..=SAMPLE_AXES => self.ram_bytes,
            _ => self.ram_bytes_12_axes,
        };
        Budget { ram_bytes, ..self }
    }

    /// Whether the image needs too much RAM, in words.
    pub(crate) fn ram_exceeded_by(&self, size: &ImageSize) -> Option<String> {
        exceeded("RAM", size.ram_bytes, self.ram_bytes)
    }

    /// What is above the budget, in words; empty if nothing is.
    pub(crate) fn exceeded_by(&self, size: &ImageSize) -> Vec<String> {
        let flash = exceeded("flash", size.flash_bytes, self.flash_bytes);
        flash
            .into_iter()
            .chain(self.ram_exceeded_by(size))
            .collect()
    }
}

fn exceeded(what: &str, used: u64, budget: u64) -> Option<String> {
    let over = used.checked_sub(budget).filter(|over| *over > 0)?;
    Some(format!(
        "the image needs {used} bytes of {what}, {over} more than the budget of {budget}"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(flash_bytes: u64, ram_bytes: u64) -> ImageSize {
        ImageSize {
            flash_bytes,
            ram_bytes,
            sections: Vec::new(),
        }
    }

    #[test]
    fn the_budget_includes_its_limit() {
        let budget = Budget {
            flash_bytes: 100,
            ram_bytes: 10,
            ram_bytes_12_axes: 20,
        };
        assert!(budget.exceeded_by(&image(100, 10)).is_empty());
        assert_eq!(
            budget.exceeded_by(&image(101, 10)),
            ["the image needs 101 bytes of flash, 1 more than the budget of 100"]
        );
        assert_eq!(budget.exceeded_by(&image(101, 12)).len(), 2);
        for (ram, axes, over) in [
            (10, 6, false),
            (11, 6, true),
            (20, 12, false),
            (21, 7, true),
        ] {
            let exceeded = budget.of(axes).ram_exceeded_by(&image(1000, ram));
            assert_eq!(exceeded.is_some(), over, "{ram} {axes}");
        }
    }

    #[test]
    fn the_projects_budget_can_be_read() {
        let budget = Budget::read().unwrap();
        assert!(budget.flash_bytes <= 64 * 1024 && budget.ram_bytes <= 16 * 1024);
        assert!(budget.ram_bytes_12_axes <= 24 * 1024);
    }

    #[test]
    fn what_is_no_elf_file_is_refused() {
        assert!(ImageSize::of(b"hello").is_err());
    }
}
