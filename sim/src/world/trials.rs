//! What must not happen to a machine in motion, done to it.

use super::watch::LAST_COMMAND;
use super::{Image, Scenario, Stimulus, World, enabled};
use crate::board::BoardError;
use crate::judge::Release;
use crate::time::Time;

/// All drives are enabled by then, counted from power-on or from the end of a
/// reset.
const READY_BY: Time = Time::from_ms(5000);
/// All axes turn this soon after the button was pressed.
const MOVING_BY: Time = Time::from_ms(1000);
/// All axes stand this soon after the board has stopped talking: the drives'
/// heartbeat consumer time of 200 ms, and the quick-stop ramp from full speed
/// with time to settle.
const STANDSTILL_BY: Time = Time::from_ms(1000);
/// The watchdog has bitten by then.
const WATCHDOG_BY: Time = Time::from_ms(500);
/// How long the machine is watched in standby: nothing may move.
const WATCHED: Time = Time::from_ms(1000);

/// A trial did not go as it must.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TrialError {
    /// The image does not boot.
    #[error(transparent)]
    Board(#[from] BoardError),
    /// The machine did something else.
    #[error("at {at} s: {what}")]
    Wrong {
        /// When.
        at: Time,
        /// What.
        what: String,
    },
}

/// The board is held in reset for `held` while all axes move, `after` the
/// start of full motion. They come to rest, and nothing moves until the button
/// is pressed again.
pub fn reset_in_motion(
    image: &Image,
    seed: u64,
    after: Time,
    held: Time,
) -> Result<(), TrialError> {
    let mut world = moving(image, seed)?;
    world.run_until(world.now() + after);
    world.apply(Stimulus::Reset(true));
    world.schedule(world.now() + held, Stimulus::Reset(false));
    comes_to_rest_and_waits(&mut world, held)
}

/// Interrupt `irq` of the board is not taken any more while all axes move: the
/// watchdog resets it. They come to rest, and nothing moves until the button is
/// pressed again.
pub fn hang_in_motion(image: &Image, seed: u64, irq: u8) -> Result<(), TrialError> {
    watchdog_in_motion(image, seed, Stimulus::Hang { irq })
}

/// The task of interrupt `irq` never ends while all axes move: the watchdog
/// resets the board. They come to rest, and nothing moves until the button is
/// pressed again.
pub fn spin_in_motion(image: &Image, seed: u64, irq: u8) -> Result<(), TrialError> {
    watchdog_in_motion(image, seed, Stimulus::Spin { irq })
}

fn watchdog_in_motion(image: &Image, seed: u64, stimulus: Stimulus) -> Result<(), TrialError> {
    let mut world = moving(image, seed)?;
    let resets = world.board().stats().resets.len();
    world.apply(stimulus);
    let limit = world.now() + WATCHDOG_BY;
    let bitten = world.run_to(limit, |world| world.board().stats().resets.len() > resets);
    must(&world, bitten, "the watchdog has not reset the board")?;
    world.watch.revoke(world.now + LAST_COMMAND);
    comes_to_rest_and_waits(&mut world, Time::ZERO)
}

/// A machine with all axes in full motion.
pub fn moving(image: &Image, seed: u64) -> Result<World<'_>, TrialError> {
    let mut world = World::new(image, Scenario::new(seed, Time::MAX).unattended())?;
    let ready = world.run_to(READY_BY, World::ready);
    must(&world, ready, "the drives are not all enabled")?;
    release(&mut world)?;
    Ok(world)
}

fn release(world: &mut World<'_>) -> Result<(), TrialError> {
    world.press();
    let limit = world.now() + MOVING_BY;
    let turning = world.run_to(limit, World::in_full_motion);
    must(world, turning, "the axes do not turn after the release")
}

fn comes_to_rest_and_waits(world: &mut World<'_>, held: Time) -> Result<(), TrialError> {
    let limit = world.now() + STANDSTILL_BY;
    let rests = world.run_to(limit, World::at_rest);
    must(world, rests, "an axis still turns")?;
    let limit = world.now() + held + READY_BY;
    let ready = world.run_to(limit, World::ready);
    must(world, ready, "the drives are not all enabled again")?;
    world.run_until(world.now() + WATCHED);
    must(
        world,
        world.statuses().flatten().all(|status| enabled(&status)),
        "a drive left standby",
    )?;
    nothing_moved_unasked(world)?;
    release(world)
}

fn nothing_moved_unasked(world: &World<'_>) -> Result<(), TrialError> {
    let unasked = world
        .watch
        .axes
        .iter()
        .any(|axis| axis.unreleased().is_some());
    let open = world
        .watch
        .releases
        .iter()
        .any(|release: &Release| !release.revoked);
    must(world, !unasked && !open, "an axis moved without a release")
}

pub(super) fn must(world: &World<'_>, holds: bool, otherwise: &str) -> Result<(), TrialError> {
    if holds {
        return Ok(());
    }
    let mut what = otherwise.to_string();
    if let Some((_, line)) = world.log().last() {
        what.push_str(&format!("; the firmware's last words: {line}"));
    }
    Err(TrialError::Wrong {
        at: world.now(),
        what,
    })
}
