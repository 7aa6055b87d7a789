//! Building the image that is flashed, and that the emulated board boots.

use std::fs::{self, File};
use std::hash::{DefaultHasher, Hash, Hasher};
use std::io;
use std::path::{Path, PathBuf};
use std::process::{self, Command, ExitCode, Stdio};
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use anyhow::{Context, Result, bail};
use serde::Deserialize;

use crate::cli::MachineOptions;
use crate::machine::Checked;
use crate::{cargo, frame_pointers, toolchain};

/// Where images are kept, each in a folder of its machine: cargo's own place is
/// taken by the next that is built.
const IMAGES: &str = "images";
/// The folder of the machine of this project.
const PROJECT: &str = "project";

/// Name of the binary.
const BINARY: &str = "canmaster";
/// Where tests find an image that is built already.
pub(crate) const IMAGE_VARIABLE: &str = "CANMASTER_ELF";

/// The same for the image of [`UNHURRIED`](crate::networks::UNHURRIED).
pub(crate) const IMAGE_10_MS_VARIABLE: &str = "CANMASTER_ELF_10_MS";

/// Leaves the firmware's measuring of itself out.
const UNMEASURED: &str = "unmeasured";

/// Tells the build script of another description of the machine.
const NETWORK_VARIABLE: &str = "CANMASTER_NETWORK";

/// The image holds every log line; the host filters.
const DEFMT_LOG: &str = "trace";
/// Room for a hundred lines or so until a debugger looks again.
const DEFMT_RTT_BUFFER_SIZE: &str = "1024";

/// `cargo xtask build`.
pub(crate) fn command(options: &MachineOptions) -> Result<ExitCode> {
    let elf = Checked::read(options.network.as_deref())?.build()?;
    println!("{}", elf.display());
    Ok(ExitCode::SUCCESS)
}

/// A cargo command for the board, with everything from outside that would make
/// another image kept away from it.
pub(crate) fn cargo_for_target(subcommand: &str) -> Command {
    let mut command = cargo::cargo();
    command
        .arg(subcommand)
        .args(["--locked", "--release", "--target", toolchain::TARGET])
        .args(["--bin", BINARY, "--features", "firmware"])
        .env("DEFMT_LOG", DEFMT_LOG)
        .env("DEFMT_RTT_BUFFER_SIZE", DEFMT_RTT_BUFFER_SIZE)
        .env_remove(NETWORK_VARIABLE)
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .env_remove("CARGO_BUILD_TARGET");
    command
}

/// Builds the image for the machine of the project and says where it is.
pub(crate) fn build() -> Result<PathBuf> {
    if let Some(image) = std::env::var_os(IMAGE_VARIABLE) {
        return Ok(PathBuf::from(image));
    }
    make(cargo_for_target("build"), PROJECT)
}

/// Builds the image for the machine that `description`, an absolute path,
/// describes.
pub(crate) fn build_for(description: &Path) -> Result<PathBuf> {
    let mut command = cargo_for_target("build");
    command.env(NETWORK_VARIABLE, description);
    make(command, &folder(description))
}

/// The same without the firmware's measuring of itself.
pub(crate) fn build_unmeasured_for(description: &Path) -> Result<PathBuf> {
    let mut command = cargo_for_target("build");
    command
        .args(["--features", UNMEASURED])
        .env(NETWORK_VARIABLE, description);
    make(command, &format!("{}-{UNMEASURED}", folder(description)))
}

/// A folder that belongs to one description: named like its own, and by a number
/// that differs from path to path.
fn folder(description: &Path) -> String {
    let parent = description.parent().and_then(Path::file_name);
    let name = parent.unwrap_or_default().to_string_lossy();
    let mut hasher = DefaultHasher::new();
    description.hash(&mut hasher);
    format!("{name}-{:08x}", hasher.finish() as u32)
}

/// Within this file's lock an image is built and taken out of cargo's own place.
const LOCK: &str = "lock";

fn make(mut command: Command, machine: &str) -> Result<PathBuf> {
    toolchain::ensure_target()?;
    frame_pointers::leave_out(&mut command);
    let images = cargo::workspace().join("target").join(IMAGES);
    let _lock = locked(&images)?;
    let output = command
        .arg("--message-format=json-render-diagnostics")
        .stdin(Stdio::null())
        .stderr(Stdio::inherit())
        .output()
        .with_context(|| format!("cannot start `{}`", cargo::line(&command)))?;
    if !output.status.success() {
        bail!(
            "the firmware does not build: `{}` ended with {}",
            cargo::line(&command),
            output.status
        );
    }
    let built = executable(&output.stdout).context("cargo built no executable of that name")?;
    keep(&built, &images.join(machine))
}

/// Waits until nobody else is building: of two at once the second would take cargo's
/// place before the first has copied what it built. Until the file is dropped.
fn locked(images: &Path) -> Result<File> {
    fs::create_dir_all(images).with_context(|| images.display().to_string())?;
    let path = images.join(LOCK);
    let open = || -> io::Result<File> {
        let file = File::create(&path)?;
        file.lock()?;
        Ok(file)
    };
    open().with_context(|| path.display().to_string())
}

/// Copies an image into a folder of its own. In one step, for somebody may be reading
/// the last one, and by a name of its own, for somebody may be doing the same.
fn keep(built: &Path, folder: &Path) -> Result<PathBuf> {
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let kept = folder.join(BINARY);
    static TURN: AtomicU32 = AtomicU32::new(0);
    let turn = TURN.fetch_add(1, Relaxed);
    let new = folder.join(format!("{BINARY}.{}.{turn}", process::id()));
    fs::copy(built, &new).with_context(|| new.display().to_string())?;
    fs::rename(&new, &kept).with_context(|| kept.display().to_string())?;
    Ok(kept)
}

/// One of cargo's messages; the others lack the fields.
#[derive(Deserialize)]
struct Message {
    target: Option<Target>,
    executable: Option<PathBuf>,
}

#[derive(Deserialize)]
struct Target {
    name: String,
}

/// Finds the image in cargo's messages.
fn executable(messages: &[u8]) -> Option<PathBuf> {
    messages
        .split(|&byte| byte == b'\n')
        .filter_map(|line| serde_json::from_slice::<Message>(line).ok())
        .filter(|message| {
            message
                .target
                .as_ref()
                .is_some_and(|target| target.name == BINARY)
        })
        .find_map(|message| message.executable)
}

#[cfg(test)]
mod tests {
    use std::{env, thread};

    use super::*;

    #[test]
    fn machines_of_the_same_name_have_folders_of_their_own() {
        let [one, other] = ["/a/mine/network.toml", "/b/mine/network.toml"].map(Path::new);
        assert!(folder(one).starts_with("mine-"));
        assert_ne!(folder(one), folder(other));
        assert_eq!(folder(one), folder(one));
    }

    #[test]
    fn many_may_keep_an_image_at_once() {
        const SIZE: usize = 1 << 18;
        let dir = env::temp_dir().join(format!("canmaster-keep-{}", process::id()));
        fs::create_dir_all(&dir).unwrap();
        let kept = dir.join("machine");
        let built: Vec<PathBuf> = (0..4)
            .map(|n| {
                let path = dir.join(format!("built-{n}"));
                fs::write(&path, vec![n; SIZE]).unwrap();
                path
            })
            .collect();
        keep(&built[0], &kept).unwrap();
        thread::scope(|scope| {
            for built in &built {
                scope.spawn(|| (0..20).for_each(|_| drop(keep(built, &kept).unwrap())));
            }
            // Whoever was last, it is a whole one.
            for _ in 0..50 {
                let bytes = fs::read(kept.join(BINARY)).unwrap();
                assert_eq!(bytes.len(), SIZE);
                assert!(bytes.iter().all(|byte| *byte == bytes[0]));
            }
        });
        let left = fs::read_dir(&kept).unwrap().count();
        fs::remove_dir_all(&dir).unwrap();
        assert_eq!(left, 1);
    }

    #[test]
    fn one_builds_at_a_time() {
        let dir = env::temp_dir().join(format!("canmaster-lock-{}", process::id()));
        let first = locked(&dir).unwrap();
        let second = File::open(dir.join(LOCK)).unwrap();
        assert!(second.try_lock().is_err());
        drop(first);
        second.lock().unwrap();
        drop(second);
        fs::remove_dir_all(&dir).unwrap();
    }

    #[test]
    fn the_image_is_found_among_the_messages() {
        let messages = br#"
{"reason":"compiler-artifact","target":{"name":"canmaster","kind":["lib"]},"executable":null}
{"reason":"compiler-artifact","target":{"name":"canmaster","kind":["bin"]},"executable":"/t/canmaster"}
{"reason":"build-finished","success":true}
"#;
        assert_eq!(executable(messages), Some(PathBuf::from("/t/canmaster")));
        assert_eq!(executable(b""), None);
    }
}
