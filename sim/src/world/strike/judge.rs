//! Whether the machine keeps the contract: nothing starts or becomes faster once the
//! stop must have begun, all stand in time, what the master stops comes to rest
//! together, and the way back leads to standby.

use canmaster::motion::mode::Mode;
use canmaster::motion::panel;
use canmaster::sdo::SdoError;

use super::draw::{Leader, Phase};
use super::lead::{self, MOVING_BY, RELEASE, START};
use super::{READY_BY, Strike, Struck};
use crate::judge::verdict::stop_tolerance;
use crate::judge::{Cause, Limit, Limits, Reaction, STANDSTILL_RPM};
use crate::time::Time;
use crate::world::trials::{TrialError, must};
use crate::world::{Client, World, enabled};

/// How long the machine is watched when it stands.
const WATCHED: Time = Time::from_ms(400);
/// How often the axes are looked at.
pub(super) const LOOK: Time = Time::from_ms(1);
/// What a drive was told before a stop is still seen in the shaft: three times the
/// 10 ms of its velocity loop. An axis told to start in the last cycle before the
/// stop may first exceed the speed that counts as standing then.
pub(super) const LOOP_TAIL: Time = Time::from_ms(30);
/// An axis that shall stop does not become faster than it has been since by more: noise
/// and the tail of its loop, rpm.
const FASTER_RPM: f64 = 40.0;
/// Axes slower than that when the stop begins are not compared, rpm: their ramps
/// are so flat that noise of 1 rpm is several milliseconds.
const COMPARED_RPM: f64 = 200.0;
/// Axes come to rest together if they reach this part of their speeds together.
const TOGETHER_PART: f64 = 0.15;
/// The firmware's limit of the following error: a part of a turn.
const FOLLOWING_PART: f64 = 0.25;
/// That of a drive that leads its own motion (6065h): turns.
const DRIVE_FOLLOWING_TURNS: f64 = 1.0;
/// How late a velocity loop and the firmware's position loop may be, as a part of
/// that limit.
const FOLLOWING_MARGIN: f64 = 1.4;
/// After the end of a move that a blocked axis has not followed, the firmware waits
/// so long for its arrival.
const ARRIVAL: Time = Time::from_ms(2100);
/// TPDOs that may be missing in a row: `[liveness]` of network.toml.
const MISSING: u64 = 3;

impl Strike {
    /// Nothing starts or becomes faster once the stop must have begun, and all stand
    /// in time.
    pub(super) fn stops(
        &self,
        world: &mut World<'_>,
        modes: &[Mode],
        at: Time,
    ) -> Result<Struck, TrialError> {
        let limits = self.cause.limits(world.machine().network(), MISSING);
        let known = match self.cause {
            Cause::Blocked => self.wait_for_following_error(world, modes, at),
            _ => at,
        };
        let latest = limits.struck.stops_by.max(limits.others.stops_by);
        world.watch.revoke(known + latest + LOOP_TAIL);
        let mut axes: Vec<Stopping> = world.truths().map(|_| Stopping::default()).collect();
        while !(world.now() > known + latest && world.at_rest()) {
            world.run_until(world.now() + LOOK);
            self.look(world, known, limits, &mut axes)?;
        }
        let others = || axes.iter().enumerate().filter(|(n, _)| !self.hits(*n));
        let coasted = (limits.struck.reaction == Reaction::Coasts).then(|| axes[self.axis].turned);
        let stood = match coasted {
            Some(_) => others().filter_map(|(_, axis)| axis.turned).max(),
            None => axes.iter().filter_map(|axis| axis.turned).max(),
        };
        let allowed = others()
            .filter_map(|(_, axis)| axis.limit)
            .max_by_key(|l| l.stands_by);
        let apart = self.apart(&axes);
        let together = stop_tolerance(Time::from(world.machine().network().cycle));
        must(
            world,
            apart.is_none_or(|apart| apart <= together),
            &format!(
                "the axes come to rest {} ms apart",
                apart.unwrap_or(Time::ZERO).as_ms()
            ),
        )?;
        Ok(Struck {
            stood_after: stood.map(|stood| stood.since(at)),
            allowed: known.since(at) + allowed.unwrap_or(limits.others).stands_by,
            coasted: coasted.flatten().map(|stood| stood.since(at)),
            apart,
            recovered: false,
        })
    }

    /// How far apart the axes that the master ramps down have come to rest; after a quick
    /// stop each has its own ramp already.
    fn apart(&self, axes: &[Stopping]) -> Option<Time> {
        let ramped = |axis: &Stopping| {
            let ramp = |limit: Limit| limit.reaction == Reaction::Ramp;
            axis.limit.is_some_and(ramp) && self.phase != Phase::QuickStop
        };
        let others = axes.iter().enumerate().filter(|(n, _)| !self.hits(*n));
        let ramped = others.filter(|(_, axis)| ramped(axis));
        let reached: Vec<Time> = ramped.filter_map(|(_, axis)| axis.slow_at).collect();
        let (last, first) = (reached.iter().max()?, reached.iter().min()?);
        Some(last.since(*first))
    }

    /// Whether the axis is the one at fault.
    fn hits(&self, axis: usize) -> bool {
        axis == self.axis
    }

    fn look(
        &self,
        world: &World<'_>,
        known: Time,
        limits: Limits,
        axes: &mut [Stopping],
    ) -> Result<(), TrialError> {
        let now = world.now();
        let modes = super::modes(world);
        for (n, (speed, axis)) in speeds(world).zip(axes).enumerate() {
            let limit = match self.hits(n) {
                true => limits.struck,
                false => limits.others,
            };
            let node = world.machine().network().nodes[n].id.get();
            if speed > STANDSTILL_RPM {
                axis.turned = Some(now);
            }
            if now < known + limit.stops_by {
                continue;
            }
            let limit = *axis.limit.get_or_insert(limit.in_mode(modes[n]));
            let from = *axis.from.get_or_insert(speed);
            let least = axis.least.get_or_insert(speed);
            *least = least.min(speed);
            not_faster(world, n, speed, *least)?;
            if from > COMPARED_RPM && speed <= from * TOGETHER_PART {
                axis.slow_at.get_or_insert(now);
            }
            let late = speed > STANDSTILL_RPM && now > known + limit.stands_by;
            must(
                world,
                !late,
                &format!("node {node} still turns: {speed:.0} rpm"),
            )?;
        }
        Ok(())
    }

    /// Runs until the blocked axis is as far behind as the master allows, or the
    /// master has noticed that it does not arrive: an axis that makes the same moves
    /// shows where it should be.
    fn wait_for_following_error(&self, world: &mut World<'_>, modes: &[Mode], at: Time) -> Time {
        let position = |world: &World<'_>, axis: usize| {
            let truth = world.truths().nth(axis).flatten();
            truth.map_or(0.0, |truth| truth.position_inc)
        };
        let assignment = world.machine().assignment();
        let set = |axis| assignment.of_axis(axis).next().map(|(_, part)| part.set);
        let others = 0..world.machine().network().nodes.len();
        let twin = others.into_iter().find(|&n| {
            !self.hits(n) && (self.leader != Leader::Button || set(n) == set(self.axis))
        });
        let twin = twin.unwrap_or(self.axis);
        let turn = f64::from(world.machine().motors()[self.axis].increments_per_turn);
        let turns = match modes[self.axis] {
            Mode::ProfilePosition => DRIVE_FOLLOWING_TURNS,
            _ => FOLLOWING_PART,
        };
        let from = position(world, twin);
        let whole = world.machine().round_trip().unwrap_or(Time::ZERO);
        while world.now() < at + whole {
            let behind = (position(world, twin) - from).abs();
            let gone = !world.round_trips().1;
            if gone || behind > turn * turns * FOLLOWING_MARGIN {
                return world.now();
            }
            if behind > 0.0 && world.at_rest() {
                return world.now() + ARRIVAL;
            }
            world.run_until(world.now() + LOOK);
        }
        world.now()
    }

    /// The machine is ready again where it overcomes the fault, and does not move
    /// before it is released. What was disabled stays so until somebody enables it.
    pub(super) fn comes_back(
        &self,
        client: &mut Client<'_>,
        struck: &mut Struck,
    ) -> Result<(), TrialError> {
        let world = &mut client.world;
        let limit = world.now() + self.lasts + READY_BY;
        if self.phase.is_unwanted() {
            world.run_until(world.now() + WATCHED);
            let any = world.statuses().flatten().any(|status| enabled(&status));
            let anew = matches!(self.cause, Cause::MasterReset | Cause::MasterHangs);
            must(world, anew || !any, "a drive is enabled against an order")?;
            lead::enable(client)?;
        }
        let world = &mut client.world;
        if self.stays() {
            world.run_until(world.now() + WATCHED);
        } else {
            let ready = world.run_to(limit, World::ready);
            must(world, ready, "the drives are not all enabled again")?;
            world.run_until(world.now() + WATCHED);
        }
        must(world, world.at_rest(), "an axis turns again")?;
        nothing_moved_unasked(world)?;
        let ready = world.ready();
        refuses(client, ready)?;
        let world = &mut client.world;
        if !ready {
            world.press();
            world.run_until(world.now() + WATCHED);
            return must(
                world,
                world.at_rest(),
                "an axis turns although it was not ready",
            );
        }
        if self.cause == Cause::Blocked {
            return Ok(());
        }
        if self.leader == Leader::Button {
            world.press();
            let turning = world.run_to(world.now() + MOVING_BY, World::in_full_motion);
            must(world, turning, "the axes do not turn after the release")?;
        } else {
            lead::moves_again(client)?;
        }
        struck.recovered = true;
        Ok(())
    }

    /// Whether somebody has to remove its cause.
    fn stays(&self) -> bool {
        match self.cause {
            Cause::DriveDisabled
            | Cause::DriveStops
            | Cause::Emergency
            | Cause::DropOut
            | Cause::Sto
            | Cause::HeartbeatLost
            | Cause::TpdosMissing
            | Cause::Blocked => true,
            Cause::SupplyLost
            | Cause::LeftOperational
            | Cause::DriveCutOff
            | Cause::MasterCutOff
            | Cause::ShortCircuit
            | Cause::MasterReset
            | Cause::MasterHangs => false,
        }
    }
}

/// One axis on its way to rest.
#[derive(Clone, Copy, Debug, Default)]
struct Stopping {
    /// What holds for it, by the mode that it was in when the stop must have begun.
    limit: Option<Limit>,
    /// Its speed then, and the lowest since.
    from: Option<f64>,
    least: Option<f64>,
    /// When it had reached [`TOGETHER_PART`] of that.
    slow_at: Option<Time>,
    /// When it was last seen to turn.
    turned: Option<Time>,
}

/// The lowest speeds of axes that are to become slower.
pub(super) struct Slowing(Vec<f64>);

impl Slowing {
    /// From now on.
    pub(super) fn new(world: &World<'_>) -> Slowing {
        Slowing(speeds(world).collect())
    }

    /// Whether they do.
    pub(super) fn look(&mut self, world: &World<'_>) -> Result<(), TrialError> {
        for (axis, (least, speed)) in self.0.iter_mut().zip(speeds(world)).enumerate() {
            *least = least.min(speed);
            not_faster(world, axis, speed, *least)?;
        }
        Ok(())
    }
}

fn speeds(world: &World<'_>) -> impl Iterator<Item = f64> {
    let truths = world.truths();
    truths.map(|truth| truth.map_or(0.0, |truth| truth.velocity_rpm.abs()))
}

fn not_faster(world: &World<'_>, axis: usize, speed: f64, least: f64) -> Result<(), TrialError> {
    let node = world.machine().network().nodes[axis].id.get();
    must(
        world,
        speed <= least + FASTER_RPM,
        &format!("node {node} becomes faster: {speed:.0} rpm after {least:.0}"),
    )
}

/// A command that cannot be carried out is refused, with a reason: a move without a
/// release, or a release of a machine that is not ready.
fn refuses(client: &mut Client<'_>, ready: bool) -> Result<(), TrialError> {
    let command = if ready { START } else { RELEASE };
    let done = client.put(panel::COMMAND, 0, command, 2);
    let refused = matches!(done, Err(SdoError::Aborted { .. }));
    must(
        &client.world,
        refused,
        &format!("command {command}: {done:?}"),
    )?;
    let why = client.number(panel::REFUSAL, 0);
    let told = why.is_ok_and(|why| why != 0);
    must(&client.world, told, "the board does not say why it refuses")
}

pub(super) fn nothing_moved_unasked(world: &World<'_>) -> Result<(), TrialError> {
    let mut axes = world.watch.axes.iter();
    let unasked = axes.any(|axis| axis.unreleased().is_some());
    must(world, !unasked, "an axis moved without a release")
}
