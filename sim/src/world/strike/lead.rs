//! Brings the machine to the moment of the fault: by the button, or as any CANopen
//! client does it.

use canmaster::id::Address;
use canmaster::motion::mode::Mode;
use canmaster::motion::{GroupState, panel};
use canmaster::sdo::{Protocol, SdoError};

use super::draw::{Leader, Modes, Phase};
use super::judge::{LOOK, LOOP_TAIL, Slowing};
use super::{READY_BY, Strike, programs};
use crate::time::Time;
use crate::world::trials::{TrialError, must};
use crate::world::{Client, World};

/// All axes turn this soon after the button was pressed.
pub(super) const MOVING_BY: Time = Time::from_ms(1000);
/// The group has seen for itself what the drives are in, or has done what was ordered.
const SEEN_BY: Time = Time::from_ms(3000);
/// How often a client asks for the state.
const ASK: Time = Time::from_ms(2);
/// The cycle that short phases are drawn for.
const CYCLE: Time = Time::from_ms(2);
/// A client's moves: increments, velocity, acceleration, jerk.
const WAY: i32 = 30_000;
const SPEED: u32 = 1500;
const SLOPE: u32 = 2500;
const JERK: u32 = 15_000;
/// Per mille of the rated torque: above all friction.
const TORQUE: i32 = 90;

/// Group commands.
pub(super) const ENABLE: u32 = 1;
const DISABLE: u32 = 2;
pub(super) const RELEASE: u32 = 3;
const STOP: u32 = 4;
const HALT: u32 = 5;
const QUICK_STOP: u32 = 6;
const HOME: u32 = 8;
const SET_MODES: u32 = 9;
pub(super) const START: u32 = 10;
const RUN: u32 = 12;

impl Strike {
    /// Brings the machine to the moment.
    pub(super) fn lead_to(&self, client: &mut Client<'_>) -> Result<(), TrialError> {
        match self.leader {
            Leader::Button => return self.by_the_button(&mut client.world),
            Leader::Client(modes) => self.by_orders(client, modes)?,
            Leader::Program(program) => self.by_a_program(client, program)?,
        }
        let cycle = Time::from(client.world.machine().network().cycle);
        match self.phase {
            Phase::ModeChange | Phase::Disable | Phase::Enable => {
                client.listen(Time(self.after.0 * (cycle.0 / CYCLE.0).max(1)));
            }
            Phase::Stop | Phase::Halt | Phase::QuickStop => return self.comes_to_rest(client),
            _ => client.listen(self.after),
        }
        Ok(())
    }

    /// After an order to stop no axis becomes faster, or starts again.
    fn comes_to_rest(&self, client: &mut Client<'_>) -> Result<(), TrialError> {
        const STOP_CYCLES: u64 = 2;
        let cycle = Time::from(client.world.machine().network().cycle);
        let end = client.world.now() + self.after;
        let begins = client.world.now() + Time(cycle.0 * STOP_CYCLES) + LOOP_TAIL;
        client.listen(self.after.min(begins.since(client.world.now())));
        let mut axes = Slowing::new(&client.world);
        while client.world.now() < end {
            client.listen(LOOK);
            axes.look(&client.world)?;
        }
        Ok(())
    }

    fn by_the_button(&self, world: &mut World<'_>) -> Result<(), TrialError> {
        if self.phase == Phase::Start {
            world.run_until(self.after);
            return Ok(());
        }
        let ready = world.run_to(READY_BY, World::ready);
        must(world, ready, "the drives are not all enabled")?;
        if self.phase == Phase::Standby {
            world.run_until(world.now() + self.after);
            return Ok(());
        }
        world.press();
        let pressed = world.now();
        match self.phase {
            Phase::Motion => {
                let whole = world.machine().round_trip().unwrap_or(Time::ZERO);
                let share = self.after.as_secs_f64();
                let after = Time::from_secs_f64(whole.as_secs_f64() * share);
                world.run_until(pressed + after);
            }
            Phase::Stop => {
                let turning = world.run_to(pressed + MOVING_BY, World::in_full_motion);
                must(world, turning, "the axes do not turn after the release")?;
                world.press();
                world.run_until(world.now() + self.after);
            }
            _ => world.run_until(pressed + self.after),
        }
        Ok(())
    }

    /// Up to the order after which the fault comes.
    fn by_orders(&self, client: &mut Client<'_>, modes: Modes) -> Result<(), TrialError> {
        let profile_velocity = Modes::All(Mode::ProfileVelocity);
        stands_by(client)?;
        if self.phase == Phase::ModeChange {
            // To it, or from it: from what the drives are configured for, if from another.
            let (from, to) = match (self.kind.is_multiple_of(2), modes == profile_velocity) {
                (_, true) => (Modes::All(Mode::CyclicPosition), modes),
                (true, false) => (profile_velocity, modes),
                (false, false) => (modes, profile_velocity),
            };
            change_modes(client, from)?;
            put_modes(client, to)?;
            return order(client, SET_MODES);
        }
        change_modes(client, modes)?;
        match self.phase {
            Phase::Standby => return Ok(()),
            Phase::Disable => return order(client, DISABLE),
            Phase::Enable => {
                order(client, DISABLE)?;
                until(client, GroupState::Idle)?;
                return order(client, ENABLE);
            }
            _ => {}
        }
        order(client, RELEASE)?;
        until(client, GroupState::Moving)?;
        match modes {
            Modes::All(Mode::Homing) => {
                order(client, HOME)?;
                until(client, GroupState::Homing)?;
            }
            _ => self.begin_a_move(client, modes)?,
        }
        let then = match self.phase {
            Phase::Stop => STOP,
            Phase::Halt => HALT,
            Phase::QuickStop => QUICK_STOP,
            _ => return Ok(()),
        };
        client.listen(self.before);
        order(client, then)
    }

    /// Neighbours go opposite ways, all as far and as fast.
    fn begin_a_move(&self, client: &mut Client<'_>, modes: Modes) -> Result<(), TrialError> {
        let axes = client.world.machine().network().nodes.len();
        let jerk = if self.kind.is_multiple_of(2) { 0 } else { JERK };
        put(client, panel::JERK, 0, jerk, 4)?;
        for axis in 0..axes {
            let way = match modes.of(axis) {
                Mode::CyclicTorque => TORQUE,
                _ => WAY,
            };
            let way = if axis % 2 == 0 { way } else { -way };
            put_move(client, axis, way)?;
        }
        order(client, START)
    }

    fn by_a_program(&self, client: &mut Client<'_>, program: usize) -> Result<(), TrialError> {
        stands_by(client)?;
        let bytes = programs::compiled(client.world.machine(), program);
        let at = Address::new(panel::PROGRAM, 0);
        let done = client.write(at, &bytes, Protocol::Normal);
        told(client, "the program", done)?;
        order(client, RUN)?;
        let then = match self.phase {
            Phase::Stop => STOP,
            Phase::Halt => HALT,
            Phase::QuickStop => QUICK_STOP,
            _ => return Ok(()),
        };
        client.listen(self.before);
        // A halt is refused where nothing moves.
        match (then, client.put(panel::COMMAND, 0, then, 2)) {
            (HALT, Err(SdoError::Aborted { .. })) => Ok(()),
            (_, done) => told(client, "a stop", done),
        }
    }
}

/// Puts all axes into profile velocity mode, releases the group, and moves them.
pub(super) fn moves_again(client: &mut Client<'_>) -> Result<(), TrialError> {
    stands_by(client)?;
    change_modes(client, Modes::All(Mode::ProfileVelocity))?;
    order(client, RELEASE)?;
    until(client, GroupState::Moving)?;
    put(client, panel::JERK, 0, 0, 4)?;
    for axis in 0..client.world.machine().network().nodes.len() {
        put_move(client, axis, WAY)?;
    }
    order(client, START)?;
    let limit = client.world.now() + MOVING_BY;
    let turning = client.world.run_to(limit, World::in_full_motion);
    must(
        &client.world,
        turning,
        "the axes do not turn after the release",
    )
}

/// Somebody wants the axes enabled again; a board that starts does not answer yet.
pub(super) fn enable(client: &mut Client<'_>) -> Result<(), TrialError> {
    const TRIES: usize = 12;
    for _ in 1..TRIES {
        if client.put(panel::COMMAND, 0, ENABLE, 2).is_ok() {
            return Ok(());
        }
        client.listen(Time::from_ms(100));
    }
    order(client, ENABLE)
}

fn stands_by(client: &mut Client<'_>) -> Result<(), TrialError> {
    let limit = client.world.now() + READY_BY;
    let ready = client.world.run_to(limit, World::ready);
    must(&client.world, ready, "the drives are not all enabled")?;
    until(client, GroupState::Standby)
}

/// Orders the modes and waits until all are confirmed.
fn change_modes(client: &mut Client<'_>, modes: Modes) -> Result<(), TrialError> {
    let of = |client: &mut Client<'_>, axis: usize| {
        let shown = client.number(panel::MODE, axis as u8 + 1);
        told(client, "the mode", shown).map(|shown| shown == modes.of(axis).code() as u32)
    };
    let axes = client.world.machine().network().nodes.len();
    let mut ordered = false;
    let limit = client.world.now() + SEEN_BY;
    loop {
        let mut all = true;
        for axis in 0..axes {
            all &= of(client, axis)?;
        }
        if all {
            return until(client, GroupState::Standby);
        }
        if !ordered {
            put_modes(client, modes)?;
            order(client, SET_MODES)?;
            ordered = true;
        }
        let late = client.world.now() > limit;
        must(&client.world, !late, "the modes are not confirmed")?;
        client.listen(ASK);
    }
}

fn put_modes(client: &mut Client<'_>, modes: Modes) -> Result<(), TrialError> {
    for axis in 0..client.world.machine().network().nodes.len() {
        let mode = u32::from(modes.of(axis).code().unsigned_abs());
        put(client, panel::MODE, axis as u8 + 1, mode, 1)?;
    }
    Ok(())
}

fn put_move(client: &mut Client<'_>, axis: usize, way: i32) -> Result<(), TrialError> {
    let sub = axis as u8 + 1;
    put(client, panel::TARGET, sub, way as u32, 4)?;
    put(client, panel::VELOCITY, sub, SPEED, 4)?;
    put(client, panel::ACCELERATION, sub, SLOPE, 4)
}

fn put(
    client: &mut Client<'_>,
    index: u16,
    sub: u8,
    number: u32,
    len: usize,
) -> Result<(), TrialError> {
    let done = client.put(index, sub, number, len);
    told(client, &format!("{index:X}h:{sub}"), done)
}

fn order(client: &mut Client<'_>, command: u32) -> Result<(), TrialError> {
    put(client, panel::COMMAND, 0, command, 2)
}

/// Waits until the group is in `state`.
fn until(client: &mut Client<'_>, state: GroupState) -> Result<(), TrialError> {
    let limit = client.world.now() + SEEN_BY;
    loop {
        let shown = client.number(panel::STATE, 0);
        let shown = told(client, "the state", shown)?;
        if shown == state as u32 {
            return Ok(());
        }
        let late = client.world.now() > limit;
        let otherwise = format!("the group does not come to {state}: 2001h = {shown}");
        must(&client.world, !late, &otherwise)?;
        client.listen(ASK);
    }
}

/// What the board has to answer.
fn told<T>(
    client: &mut Client<'_>,
    what: &str,
    done: Result<T, SdoError>,
) -> Result<T, TrialError> {
    done.map_err(|error| {
        let why = client.number(panel::REFUSAL, 0).unwrap_or(0);
        TrialError::Wrong {
            at: client.world.now(),
            what: format!("{what} is refused: {error}; 2002h = {why:08X}h"),
        }
    })
}
