//! Building the image that is flashed, and that the emulated board boots.

use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

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
/// Room for the burst of lines while six drives are configured at once.
const DEFMT_RTT_BUFFER_SIZE: &str = "2048";

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

fn make(mut command: Command, machine: &str) -> Result<PathBuf> {
    toolchain::ensure_target()?;
    frame_pointers::leave_out(&mut command);
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
    let kept = cargo::workspace().join("target").join(IMAGES).join(machine);
    fs::create_dir_all(&kept).with_context(|| kept.display().to_string())?;
    let kept = kept.join(BINARY);
    // In one step, for somebody may be reading the last one.
    let new = kept.with_extension("new");
    fs::copy(&built, &new).with_context(|| new.display().to_string())?;
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
    use super::*;

    #[test]
    fn machines_of_the_same_name_have_folders_of_their_own() {
        let [one, other] = ["/a/mine/network.toml", "/b/mine/network.toml"].map(Path::new);
        assert!(folder(one).starts_with("mine-"));
        assert_ne!(folder(one), folder(other));
        assert_eq!(folder(one), folder(one));
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
