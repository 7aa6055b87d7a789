//! A motion program on its way to the running board: as a domain object by SDO, the
//! way any CANopen tool would do it; nothing is flashed.

use anyhow::{Result, bail, ensure};
use canmaster::id::Address;
use canmaster::motion::panel;
use canmaster::sdo::Protocol;
use canmaster_network::program::Program;
use canmaster_sim::time::Time;
use canmaster_sim::world::{Client, World};

/// All drives are enabled by then.
const READY_BY: Time = Time::from_ms(12_000);
/// Where a refused program's step stands in 2002h.
const STEP: u32 = 0xFFFF;

/// Waits until the machine is ready, downloads the program, and presses the button.
pub(super) fn before_the_release<'i>(mut world: World<'i>, program: &Program) -> Result<World<'i>> {
    let bytes = program.bytes();
    ensure!(
        bytes.len() <= panel::PROGRAM_BYTES,
        "\"{}\" has {} bytes, and the board takes {}: use fewer points, or build it into the \
         image ([group] program in network.toml)",
        program.name,
        bytes.len(),
        panel::PROGRAM_BYTES
    );
    ensure!(
        world.run_to(READY_BY, World::ready),
        "not all drives were enabled after {READY_BY} s; see `cargo xtask run`"
    );
    let node = world.machine().network().master.node;
    let mut client = Client::new(world, node);
    let at = Address::new(panel::PROGRAM, 0);
    if let Err(error) = client.write(at, &bytes, Protocol::Normal) {
        let why = client.number(panel::REFUSAL, 0);
        let step = why.map_or(0, |why| why & STEP);
        match program.line_of(step as u16) {
            Some(line) => bail!("the board refuses line {line} (step {step}): {error}"),
            None => bail!("the board refuses the program: {error}"),
        }
    }
    eprintln!(
        "\"{}\" is on the board: {} bytes.",
        program.name,
        bytes.len()
    );
    let mut world = client.world;
    world.press();
    Ok(world)
}
