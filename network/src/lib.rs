//! A machine is described once, in `network.toml`, beside the EDS files of its
//! devices. This reads the description, looks everything up, refuses what cannot
//! work with the line that is wrong, and derives the rest: the firmware's
//! constants, the concise DCF of each node, a DBC.
//!
//! The crate knows nothing of the firmware and nothing of the library that the
//! firmware is made of, so that the firmware's build script can use it.

mod check;
mod cycles;
pub mod derive;
mod description;
pub mod eds;
pub mod frame;
pub mod layout;
pub mod model;
pub mod object;
pub mod plan;
mod problem;
pub mod program;
mod resolve;
pub mod s1;
mod source;
pub mod timing;

pub use problem::{Problem, Severity};
pub use source::Source;

use std::io::{self, Read};
use std::path::{Path, PathBuf};

use description::Description;
use model::Machine;
use problem::{Place, Problems};

/// What came of reading a description.
#[derive(Debug)]
#[non_exhaustive]
pub struct Outcome {
    /// The machine, if there is no error.
    pub machine: Option<Machine>,
    /// Everything that is wrong, in the order in which it was found.
    pub problems: Vec<Problem>,
    /// The names of all files that were read or looked for: a build depends on
    /// them.
    pub files: Vec<String>,
}

/// Reads and checks the description at `path`, also against what the firmware of
/// this project can do.
pub fn load(path: &Path) -> Outcome {
    let name = path.display().to_string();
    match read_file(path) {
        Ok(bytes) => {
            let source = Source::new(name, &bytes);
            read_for_firmware(&source, &mut read_file)
        }
        Err(error) => {
            let source = Source::new(&name, b"");
            let mut problems = Problems::default();
            problems.error(
                &Place::file(&source),
                &name,
                format!("the file cannot be read: {error}"),
                "give the path of a network.toml; `cargo xtask new DIR` makes one",
            );
            Outcome {
                machine: None,
                problems: problems.into_vec(),
                files: vec![name],
            }
        }
    }
}

/// No description and no EDS is longer.
const LONGEST_FILE: u64 = 16 * 1024 * 1024;

/// The bytes of a file, if it has no more than anybody would write.
fn read_file(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path)?;
    file.take(LONGEST_FILE + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > LONGEST_FILE {
        return Err(io::ErrorKind::FileTooLarge.into());
    }
    Ok(bytes)
}

/// The same from memory: `open` gives the bytes of the files that the description
/// names, relative to its own folder.
pub fn read_for_firmware(source: &Source, open: &mut Open<'_>) -> Outcome {
    outcome(source, open, true)
}

/// What any CANopen master may do, from memory: the rules of the standard, the
/// devices and the bus.
pub fn read(source: &Source, open: &mut Open<'_>) -> Outcome {
    outcome(source, open, false)
}

/// Gives the bytes of a file.
pub type Open<'a> = dyn FnMut(&Path) -> io::Result<Vec<u8>> + 'a;

fn outcome(source: &Source, open: &mut Open<'_>, for_firmware: bool) -> Outcome {
    let mut problems = Problems::default();
    let mut files = vec![source.name().to_string()];
    let folder = Path::new(source.name())
        .parent()
        .map_or_else(PathBuf::new, Path::to_path_buf);
    let mut open = |name: &str| {
        let path = folder.join(name);
        // The same words on every system.
        let shown = path.display().to_string().replace('\\', "/");
        files.push(shown.clone());
        open(&path).map(|bytes| Source::new(shown, &bytes))
    };
    let machine = Description::read(source, &mut problems).and_then(|description| {
        let machine =
            resolve::machine(&description, source, &mut open, for_firmware, &mut problems);
        machine.filter(|_| !problems.has_errors())
    });
    Outcome {
        machine,
        problems: problems.into_vec(),
        files,
    }
}
