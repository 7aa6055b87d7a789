//! Gives the firmware image its linker script and what follows from the
//! description of the machine; for the library it does nothing.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rustc-check-cfg=cfg(fdcan1, fdcan2, fdcan3)");
    #[cfg(feature = "firmware")]
    if std::env::var("CARGO_CFG_TARGET_OS").as_deref() == Ok("none") {
        firmware::prepare();
    }
}

#[cfg(feature = "firmware")]
mod firmware {
    use std::path::{Path, PathBuf};
    use std::{env, fs};

    use canmaster_network::{Severity, derive, load};

    /// Names the description, if it is another.
    const VARIABLE: &str = "CANMASTER_NETWORK";
    const DESCRIPTION: &str = "network.toml";
    const LINKER_SCRIPT: &str = "memory.x";

    pub(super) fn prepare() {
        let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
        println!("cargo::rerun-if-changed={LINKER_SCRIPT}");
        fs::copy(LINKER_SCRIPT, out.join(LINKER_SCRIPT)).expect("memory.x can be copied");
        println!("cargo::rustc-link-search={}", out.display());
        // Not in .cargo/config.toml: a RUSTFLAGS variable would silently replace
        // them there, and the image would link without its vector table.
        // Functions that are the same byte for byte are kept once: no pointers to
        // functions are compared.
        for argument in ["--nmagic", "-Tlink.x", "-Tdefmt.x", "--icf=all"] {
            println!("cargo::rustc-link-arg-bins={argument}");
        }
        constants(&out);
    }

    /// Checks the description and writes its constants, or refuses it.
    fn constants(out: &Path) {
        println!("cargo::rerun-if-env-changed={VARIABLE}");
        let path = env::var_os(VARIABLE).map_or_else(|| DESCRIPTION.into(), PathBuf::from);
        let outcome = load(&path);
        for file in &outcome.files {
            println!("cargo::rerun-if-changed={file}");
        }
        for problem in &outcome.problems {
            let level = match problem.severity {
                Severity::Error => "error",
                Severity::Warning => "warning",
            };
            // Cargo puts the level before each line.
            for line in problem.to_string().lines() {
                println!("cargo::{level}={line}");
            }
        }
        let Some(machine) = outcome.machine else {
            // Cargo ends the build because of the errors.
            return;
        };
        for bus in &machine.buses {
            // The controllers whose tasks are there.
            println!("cargo::rustc-cfg=fdcan{}", bus.peripheral);
        }
        let text = derive::rust(&machine, "canmaster");
        fs::write(out.join("network.rs"), text).expect("OUT_DIR can be written to");
    }
}
