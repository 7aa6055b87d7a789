//! The firmware image. On the host there is nothing to run.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("canmaster is firmware: use `cargo xtask run` or `cargo xtask flash`");
    std::process::exit(2);
}
