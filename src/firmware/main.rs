//! The firmware image: an RTIC 2 application that wires the library `canmaster`
//! to the NUCLEO-G474RE. On the host there is nothing to run.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod app;
#[cfg(target_os = "none")]
mod asking;
#[cfg(target_os = "none")]
mod axes;
#[cfg(target_os = "none")]
mod configurator;
#[cfg(target_os = "none")]
mod control;
#[cfg(target_os = "none")]
mod counters;
#[cfg(target_os = "none")]
mod derived;
#[cfg(target_os = "none")]
mod duties;
#[cfg(target_os = "none")]
mod filters;
#[cfg(target_os = "none")]
mod hard_fault;
#[cfg(target_os = "none")]
mod heartbeats;
#[cfg(target_os = "none")]
mod leds;
#[cfg(target_os = "none")]
mod lines;
#[cfg(target_os = "none")]
mod log;
#[cfg(target_os = "none")]
mod measured;
#[cfg(target_os = "none")]
mod own_node;
#[cfg(target_os = "none")]
mod reception;
#[cfg(target_os = "none")]
mod report;
#[cfg(target_os = "none")]
mod roll;
#[cfg(target_os = "none")]
mod settings;
#[cfg(target_os = "none")]
mod transfer;
#[cfg(target_os = "none")]
mod wake;

#[cfg(all(target_os = "none", not(feature = "firmware")))]
compile_error!("the image needs the feature `firmware`; `cargo xtask build` makes it");

#[cfg(target_os = "none")]
use defmt_rtt as _;

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("canmaster is firmware: use `cargo xtask run` or `cargo xtask flash`");
    std::process::exit(2);
}
