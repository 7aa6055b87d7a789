//! A motion program on its way to the running board: as a domain object by SDO, the
//! way any CANopen tool would do it; nothing is flashed.

use anyhow::{Result, bail, ensure};
use canmaster::id::Address;
use canmaster::motion::{GroupState, panel};
use canmaster::sdo::Protocol;
use canmaster_network::program::Program;
use canmaster_sim::time::Time;
use canmaster_sim::world::{Client, World};

/// All drives are enabled by then.
const READY_BY: Time = Time::from_ms(12_000);
/// How often the board is asked, and how often in all.
const ASK: Time = Time::from_ms(10);
const ASKED_MAX: usize = 100;
/// Where a refused program's step stands in 2002h, and the reason, which is one of a
/// program from that number on.
const STEP: u32 = 0xFFFF;
const REASON_SHIFT: u32 = 16;
const REASON: u32 = 0xFF;
const OF_A_PROGRAM: u32 = 16;

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
    stands_by(&mut client)?;
    let at = Address::new(panel::PROGRAM, 0);
    if let Err(error) = client.write(at, &bytes, Protocol::Normal) {
        let why = client.number(panel::REFUSAL, 0).unwrap_or(0);
        let of_a_step = why >> REASON_SHIFT & REASON >= OF_A_PROGRAM;
        let step = if of_a_step { why & STEP } else { 0 };
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

/// Waits until the group has seen for itself that all drives are enabled and at rest.
fn stands_by(client: &mut Client<'_>) -> Result<()> {
    for _ in 0..ASKED_MAX {
        if client.number(panel::STATE, 0)? == GroupState::Standby as u32 {
            return Ok(());
        }
        client.listen(ASK);
    }
    bail!("the group does not come to standby; see `cargo xtask run`")
}
