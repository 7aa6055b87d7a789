//! Machines that differ from one of `networks/` by nothing but their description: number
//! of nodes, bit rate, cycle, mapping. No Rust code is changed for any of them.

use std::fmt::Write;
use std::fs;
use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use canmaster_network::{Source, read_for_firmware};
use canmaster_sim::judge::Outcome;
use canmaster_sim::world::{Image, Record, Scenario, World};

use crate::image::{Budget, ImageSize};
use crate::machine::{Checked, DESCRIPTION, counted};
use crate::{cargo, new, run};

/// Numbers of drives.
const AXES: [u8; 4] = [1, 3, 6, 12];
/// bit/s
const BIT_RATES: [u32; 3] = [125_000, 500_000, 1_000_000];
/// The one that they differ from, which has time for more axes and slower buses.
pub(crate) const UNHURRIED: &str = "networks/one_bus_10ms.toml";
/// Where its nodes begin.
const NODES: &str = "[[node]]";
const PER_KILO: u32 = 1000;
/// Cycles are whole milliseconds: 60C2h has that unit.
const MS_US: u32 = 1000;
/// The serial number of the first drive is the one after this.
const SERIALS: u32 = 0x2700_0000;

/// One of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Variant {
    axes: u8,
    bit_rate: u32,
    /// The objects in another order, the torque left out.
    remapped: bool,
}

/// A variant that was built.
pub(crate) struct Built {
    /// To be run.
    pub(crate) image: Image,
    /// To be weighed.
    pub(crate) size: ImageSize,
}

const fn variant(axes: u8, bit_rate: u32, remapped: bool) -> Variant {
    Variant {
        axes,
        bit_rate,
        remapped,
    }
}

/// Four that have every number of drives and every bit rate.
pub(crate) const FOUR: [Variant; 4] = [
    variant(1, 125_000, false),
    variant(3, 500_000, true),
    variant(6, 1_000_000, true),
    variant(12, 1_000_000, false),
];

/// Every number of drives at every bit rate.
pub(crate) fn all() -> impl Iterator<Item = Variant> {
    AXES.into_iter()
        .flat_map(|axes| BIT_RATES.map(|bit_rate| variant(axes, bit_rate, false)))
}

/// [`UNHURRIED`] as it reads beside the folder of the EDS files.
fn sample() -> Result<String> {
    let path = cargo::workspace().join(UNHURRIED);
    let text = fs::read_to_string(&path).with_context(|| path.display().to_string())?;
    Ok(text.replace("../eds/", "eds/"))
}

/// Builds and runs [`FOUR`].
pub(crate) fn four() -> Result<()> {
    for variant in FOUR {
        let name = variant.name();
        eprintln!("Building the firmware for {name}.");
        let built = variant.build()?;
        let record = variant.run(&built.image, 1).context(name.clone())?;
        good(&record).context(name.clone())?;
        eprintln!(
            "{name}: {} moves arrived, {} bytes of RAM",
            record.arrivals.len(),
            built.size.ram_bytes
        );
    }
    Ok(())
}

/// Every move of every drive arrived.
pub(crate) fn good(record: &Record) -> Result<()> {
    let verdict = &record.verdict;
    if verdict.outcome != Outcome::Ok {
        bail!("{}: {}", verdict.outcome, verdict.reason);
    }
    Ok(())
}

/// Longer than any needs, and shorter than the master's heartbeat.
const LONG_MS: u32 = 55;
/// The master's heartbeat, for twelve drives at 125 kbit/s need a cycle of 49 ms.
const HEARTBEAT_MS: u32 = 60;

impl Variant {
    /// In words.
    pub(crate) fn name(&self) -> String {
        let kilobits = self.bit_rate / PER_KILO;
        let mapped = if self.remapped { ", other mapping" } else { "" };
        let drives = counted(self.axes.into(), "drive");
        format!("{drives} at {kilobits} kbit/s{mapped}")
    }

    /// Writes the description and builds the image; too large is an error.
    pub(crate) fn build(&self) -> Result<Built> {
        let checked = Checked::read(Some(&self.write()?))?;
        let elf = checked.build()?;
        let size = ImageSize::read(&elf)?;
        let over = Budget::read()?.of(self.axes.into()).ram_exceeded_by(&size);
        if let Some(words) = over {
            bail!("{}: {words} ({})", self.name(), Budget::FILE);
        }
        Ok(Built {
            image: checked.image(&elf)?,
            size,
        })
    }

    /// A start and one round trip.
    pub(crate) fn run(&self, image: &Image, seed: u64) -> Result<Record> {
        let scenario = Scenario::new(seed, run::default_end(image.machine()));
        let world = World::new(image, scenario).context("the emulated board cannot boot")?;
        Ok(world.run(&mut ()))
    }

    /// Puts the machine into a folder of its own and says where its description is.
    fn write(&self) -> Result<PathBuf> {
        let mapped = if self.remapped { "-remapped" } else { "" };
        let folder = format!("{}-at-{}{mapped}", self.axes, self.bit_rate);
        let dir = cargo::workspace()
            .join("target")
            .join("networks")
            .join(folder);
        new::copy(&dir)?;
        let path = dir.join(DESCRIPTION);
        let sample = sample()?;
        let text = self.describe(&sample, self.shortest_cycle(&sample, &dir)?);
        fs::write(&path, text).with_context(|| path.display().to_string())?;
        Ok(path)
    }

    /// The shortest cycle of whole milliseconds that the check lets through.
    fn shortest_cycle(&self, sample: &str, dir: &std::path::Path) -> Result<u32> {
        let text = self.describe(sample, LONG_MS * MS_US);
        let name = dir.join(DESCRIPTION).display().to_string();
        let source = Source::new(name, text.as_bytes());
        let outcome = read_for_firmware(&source, &mut |file| fs::read(file));
        let machine = outcome.machine.as_ref();
        let bus = machine.and_then(|machine| machine.buses.first());
        let smallest = bus.and_then(|bus| bus.layout.demand.smallest_cycle());
        let smallest = smallest.with_context(|| format!("{:?}", outcome.problems))?;
        Ok(smallest.next_multiple_of(MS_US))
    }

    /// Its description with other numbers.
    fn describe(&self, sample: &str, cycle_us: u32) -> String {
        let common = sample.split(NODES).next().unwrap_or_default();
        let mut text = String::new();
        let mut skip = false;
        let mut of_master = true;
        for line in common.lines() {
            let key = line.split('=').next().unwrap_or_default().trim();
            match key {
                "heartbeat_ms" if of_master => {
                    of_master = false;
                    let _ = writeln!(text, "heartbeat_ms = {HEARTBEAT_MS}");
                }
                "bit_rate" => {
                    let _ = writeln!(text, "bit_rate = {}", self.bit_rate);
                }
                "cycle_us" => {
                    let _ = writeln!(text, "cycle_us = {cycle_us}");
                }
                // They follow from the others.
                "tpdo_deadline_us" | "compute_us" | "guard_us" => skip = true,
                // The rest of their comment.
                "" if skip => {}
                _ if skip && line.trim_start().starts_with('#') && line.starts_with(' ') => {}
                _ => {
                    skip = false;
                    let line = if self.remapped { remapped(line) } else { line };
                    text.push_str(line);
                    text.push('\n');
                }
            }
        }
        for axis in 1..=self.axes {
            // Node-IDs with gaps.
            let (id, serial) = (axis * 2 + 1, SERIALS + u32::from(axis));
            let _ = writeln!(
                text,
                "{NODES}\nid = {id}\nname = \"drive {axis}\"\ndevice = \"epos4\"\nserial = {serial}\n"
            );
        }
        text
    }
}

/// A line of it with another mapping.
fn remapped(line: &str) -> &str {
    match line.trim() {
        r#"map = ["Controlword", "Target velocity"]"# => {
            r#"map = ["Target velocity", "Controlword"]"#
        }
        r#"map = ["Profile acceleration", "Profile deceleration"]"# => {
            r#"map = ["Profile deceleration", "Profile acceleration"]"#
        }
        r#"map = ["Statusword", "Position actual value"]"# => {
            r#"map = ["Velocity actual value", "Statusword"]"#
        }
        r#"map = ["Velocity actual value", "Torque actual value"]"# => {
            r#"map = ["Position actual value"]"#
        }
        _ => line,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_have_every_number_of_drives_and_every_bit_rate() {
        for axes in AXES {
            assert!(FOUR.iter().any(|variant| variant.axes == axes));
        }
        for bit_rate in BIT_RATES {
            assert!(FOUR.iter().any(|variant| variant.bit_rate == bit_rate));
        }
    }

    #[test]
    fn the_check_knows_how_often_ramps_are_sent() {
        let again = u64::from(canmaster::master::RAMPS_AGAIN);
        assert_eq!(again, canmaster_network::layout::RAMPS_AGAIN);
    }

    #[test]
    fn every_description_is_accepted() {
        let workspace = cargo::workspace();
        let sample = sample().unwrap();
        for variant in all().chain(FOUR) {
            let cycle = variant.shortest_cycle(&sample, &workspace).unwrap();
            let text = variant.describe(&sample, cycle);
            let name = workspace.join(DESCRIPTION).display().to_string();
            let source = Source::new(name, text.as_bytes());
            let outcome = read_for_firmware(&source, &mut |file| fs::read(file));
            assert!(outcome.problems.is_empty(), "{:?}", outcome.problems);
            let machine = outcome.machine.unwrap();
            assert_eq!(machine.nodes.len(), usize::from(variant.axes));
            assert_eq!(machine.buses[0].bit_rate, variant.bit_rate);
            let of_tpdo1 = machine.nodes[0].tpdos[0].mapping[0].at.index;
            assert_eq!(of_tpdo1, if variant.remapped { 0x606C } else { 0x6041 });
        }
    }
}
