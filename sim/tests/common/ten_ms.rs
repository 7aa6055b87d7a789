//! The image of `networks/one_bus_10ms.toml`: its drives have both TPDOs and send
//! their heartbeats in operational, too.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use canmaster_sim::world::{Image, Machine};

use crate::common::build;

/// Where `cargo xtask test` says that it is.
const VARIABLE: &str = "CANMASTER_ELF_10_MS";

pub(crate) fn image() -> &'static Image {
    static IMAGE: LazyLock<Image> = LazyLock::new(|| {
        let workspace = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        let description = workspace.join("networks/one_bus_10ms.toml");
        let build = || build(&["--network".as_ref(), description.as_ref()]);
        let path = std::env::var_os(VARIABLE).map_or_else(build, PathBuf::from);
        let image = Image::read(&path).unwrap_or_else(|error| panic!("{error}"));
        image.built_for(Machine::read(&description).unwrap())
    });
    &IMAGE
}
