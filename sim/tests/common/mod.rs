//! The image that the tests boot.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use canmaster_sim::world::Image;

/// Where `cargo xtask test` says that the image is.
const VARIABLE: &str = "CANMASTER_ELF";

/// The firmware image, built if nobody has built it.
pub(crate) fn image() -> &'static Image {
    static IMAGE: LazyLock<Image> = LazyLock::new(|| {
        let path = std::env::var_os(VARIABLE).map_or_else(|| build(&[]), PathBuf::from);
        Image::read(&path).unwrap_or_else(|error| panic!("{error}"))
    });
    &IMAGE
}

/// Has xtask build an image; it says where.
pub(crate) fn build(options: &[&OsStr]) -> PathBuf {
    let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let output = Command::new(env!("CARGO"))
        .args(["xtask", "build"])
        .args(options)
        .current_dir(workspace)
        .output()
        .expect("cargo can be started");
    assert!(
        output.status.success(),
        "the firmware does not build: `cargo xtask build`"
    );
    PathBuf::from(String::from_utf8(output.stdout).unwrap().trim())
}
