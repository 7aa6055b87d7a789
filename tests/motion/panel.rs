//! Objects 2000h to 2010h: what a client can do with the group, and what it is told.

use canmaster::id::Address;
use canmaster::motion::panel::{self, PROGRAM_BYTES, Panel};
use canmaster::motion::{Cause, GroupEvent, GroupState, Inputs};
use canmaster::od::Part;
use canmaster::sdo::AbortCode;
use canmaster_network::program::Action;

use crate::compiled::compiled;
use crate::rig::{AXES, READY, Rig};

struct Desk {
    rig: Rig,
    panel: Panel<AXES>,
    /// Notices that the panel has heard.
    told: usize,
}

impl Desk {
    fn new() -> Desk {
        Desk {
            rig: Rig::standby(1),
            panel: Panel::new(),
            told: 0,
        }
    }

    fn set(&mut self, index: u16, sub: u8, value: i32) -> Result<(), AbortCode> {
        let Rig {
            group, director, ..
        } = &mut self.rig;
        let at = Address::new(index, sub);
        self.panel.set(at, value as u32, group, director)
    }

    fn get(&self, index: u16, sub: u8) -> i32 {
        let at = Address::new(index, sub);
        let value = self.panel.get(at, &self.rig.group, &self.rig.director);
        value as i32
    }

    /// Refused with `code`, and with this in 2002h.
    #[track_caller]
    fn refused(&mut self, index: u16, sub: u8, value: i32, code: AbortCode, why: u32) {
        assert_eq!(self.set(index, sub, value), Err(code));
        assert_eq!(
            format!("{:08X}", self.get(panel::REFUSAL, 0)),
            format!("{why:08X}")
        );
    }

    fn command(&mut self, command: i32) {
        assert_eq!(self.set(panel::COMMAND, 0, command), Ok(()), "{command}");
        assert_eq!(self.get(panel::COMMAND, 0), command);
    }

    fn step(&mut self, inputs: Inputs) {
        self.rig.step(inputs);
        self.panel.poll(&mut self.rig.group);
        let events = std::mem::take(&mut self.rig.events);
        for event in events.iter().chain(&self.rig.notices[self.told..]) {
            self.panel.on_event(event);
        }
        self.told = self.rig.notices.len();
    }

    #[track_caller]
    fn until(&mut self, state: GroupState) {
        let came = (0..2000).any(|_| {
            self.step(READY);
            self.get(panel::STATE, 0) == state as i32
        });
        assert!(came, "{state} is not reached: {}", self.rig.last());
    }

    fn write(&mut self, offset: u32, data: &[u8], last: bool) -> Result<(), AbortCode> {
        let part = Part {
            offset,
            data,
            size: None,
            last,
        };
        let Rig {
            group, director, ..
        } = &mut self.rig;
        self.panel.write(&part, group.state(), director)
    }
}

/// A program of one step: wait for 100 ms.
fn one_wait() -> Vec<u8> {
    compiled("[[step]]\nwait_ms = 100").bytes()
}

const STATE: AbortCode = AbortCode::DEVICE_STATE;
const VALUE: AbortCode = AbortCode::VALUE_RANGE;

#[test]
fn release_move_and_stop() {
    let mut desk = Desk::new();
    desk.command(3);
    desk.until(GroupState::Moving);
    for axis in 1..=6 {
        desk.set(panel::TARGET, axis, 1000 * i32::from(axis))
            .unwrap();
        desk.set(panel::VELOCITY, axis, 1200).unwrap();
        desk.set(panel::ACCELERATION, axis, 2000).unwrap();
        assert_eq!(desk.get(panel::TARGET, axis), 1000 * i32::from(axis));
    }
    let homes: Vec<i32> = (1..=6)
        .map(|axis| desk.get(panel::POSITION, axis))
        .collect();
    desk.command(10);
    for _ in 0..200 {
        desk.step(READY);
    }
    for (axis, home) in (1..=6).zip(homes) {
        let moved = desk.get(panel::POSITION, axis) - home;
        assert!(
            (moved - 1000 * i32::from(axis)).abs() <= 3,
            "{axis}: {moved}"
        );
        assert!(desk.get(panel::FOLLOWING_ERROR, axis).abs() <= 3);
        assert!(desk.get(panel::ACTUAL_VELOCITY, axis).abs() <= 5);
        assert_eq!(desk.get(panel::STATUSWORD, axis) & 0x6F, 0x27);
    }
    desk.command(4);
    desk.until(GroupState::Standby);
}

#[test]
fn a_part_of_the_axes_moves() {
    let mut desk = Desk::new();
    desk.set(panel::AXES, 0, 0b10).unwrap();
    desk.set(panel::TARGET, 2, 5000).unwrap();
    desk.set(panel::VELOCITY, 2, 1000).unwrap();
    desk.set(panel::ACCELERATION, 2, 2000).unwrap();
    desk.command(3);
    desk.until(GroupState::Moving);
    let before = desk.get(panel::REFERENCE, 1);
    desk.command(10);
    for _ in 0..200 {
        desk.step(READY);
    }
    assert_eq!(desk.get(panel::REFERENCE, 1), before);
    assert!((desk.get(panel::POSITION, 2) - desk.get(panel::REFERENCE, 2)).abs() <= 3);
}

#[test]
fn what_the_state_forbids_is_refused_with_the_state() {
    let mut desk = Desk::new();
    let standby = GroupState::Standby as u32;
    for command in [5, 7, 8, 10, 11] {
        desk.refused(panel::COMMAND, 0, command, STATE, 0xFF01_0000 | standby);
    }
    desk.command(3);
    desk.until(GroupState::Moving);
    let moving = GroupState::Moving as u32;
    for command in [3, 7, 9, 12] {
        desk.refused(panel::COMMAND, 0, command, STATE, 0xFF01_0000 | moving);
    }
    // A refused command is not the last one.
    assert_eq!(desk.get(panel::COMMAND, 0), 3);
    desk.command(6);
    desk.until(GroupState::Idle);
    desk.refused(panel::COMMAND, 0, 3, STATE, 0xFF01_0000);
    desk.command(1);
    desk.until(GroupState::Standby);
    desk.command(2);
    desk.until(GroupState::Idle);
}

#[test]
fn what_no_axis_can_do_is_refused_with_the_axis() {
    let mut desk = Desk::new();
    desk.refused(panel::COMMAND, 0, 13, VALUE, 0xFF08_000D);
    desk.refused(panel::AXES, 0, 0x40, VALUE, 0xFF08_0040);
    for mode in [0, 2, 4, 7, 11, -1] {
        let code = mode as u32 & 0xFF;
        desk.refused(panel::MODE, 3, mode, VALUE, 0x0306_0000 | code);
    }
    desk.command(3);
    desk.until(GroupState::Moving);
    // Home is searched in homing mode.
    desk.refused(panel::COMMAND, 0, 8, STATE, 0x0105_0003);
    desk.set(panel::AXES, 0, 0b1000).unwrap();
    desk.set(panel::VELOCITY, 4, 100_000).unwrap();
    desk.set(panel::ACCELERATION, 4, 1000).unwrap();
    assert_eq!(desk.set(panel::COMMAND, 0, 10), Err(VALUE));
    assert_eq!(desk.get(panel::REFUSAL, 0) as u32 >> 16, 0x041C);
}

/// What is found only when it is planned stands in 2002h as well.
#[test]
fn what_the_plan_refuses_is_told() {
    let told = |desk: &Desk| format!("{:08X}", desk.get(panel::REFUSAL, 0));
    let mut desk = Desk::new();
    // The button, which obeys while the group comes to rest.
    desk.command(3);
    desk.until(GroupState::Moving);
    desk.command(4);
    desk.step(READY);
    let Rig {
        group, director, ..
    } = &mut desk.rig;
    director.press(group);
    desk.step(READY);
    assert_eq!(told(&desk), "FF010004");
    // A move that takes too long.
    let mut desk = Desk::new();
    desk.command(3);
    desk.until(GroupState::Moving);
    desk.set(panel::AXES, 0, 0b10).unwrap();
    desk.set(panel::TARGET, 2, 1_000_000_000).unwrap();
    desk.set(panel::VELOCITY, 2, 1).unwrap();
    desk.set(panel::ACCELERATION, 2, 2000).unwrap();
    desk.command(10);
    desk.step(READY);
    desk.step(READY);
    assert_eq!(told(&desk), "0221FFFF");
    // A step of a program.
    let text = "velocity = 600\nacceleration = 2000\n[[step]]\nwait_ms = 10\n[[step]]\n\
        [[step.move]]\naxes = [\"axis 3\"]\nby = 10_000_000";
    let mut program = compiled(text);
    let Action::Move(a_move) = &mut program.steps[1].action else {
        panic!("{:?}", program.steps);
    };
    // The compiler would refuse it; other tools may not.
    a_move.parts[0].velocity = 1;
    let mut desk = Desk::new();
    desk.rig.program = program.bytes();
    desk.command(12);
    desk.until(GroupState::Standby);
    assert_eq!(told(&desk), "03210002");
}

#[test]
fn a_release_while_an_axis_is_missing_is_refused_with_the_axis() {
    let mut desk = Desk::new();
    desk.rig.silent[4] = true;
    desk.step(READY);
    desk.refused(panel::COMMAND, 0, 3, STATE, 0x0502_0000);
    desk.refused(panel::COMMAND, 0, 12, STATE, 0x0502_0000);
    desk.rig.silent[4] = false;
    desk.step(READY);
    desk.command(3);
}

#[test]
fn modes_of_several_kinds_one_after_the_other() {
    let mut desk = Desk::new();
    for (axis, mode) in (1..=6).zip([8, 9, 8, 10, 1, 6]) {
        desk.set(panel::MODE, axis, mode).unwrap();
        assert_eq!(desk.get(panel::MODE, axis), 3, "confirmed");
    }
    desk.command(9);
    for _ in 0..100 {
        desk.step(READY);
    }
    assert_eq!(desk.get(panel::STATE, 0), GroupState::Standby as i32);
    for (axis, mode) in (1..=6).zip([8, 9, 8, 10, 1, 6]) {
        assert_eq!(desk.get(panel::MODE, axis), mode);
    }
}

#[test]
fn the_first_fault_of_an_axis_is_kept_until_it_is_enabled_again() {
    let mut desk = Desk::new();
    let fault = |code| GroupEvent::Fault {
        axis: Some(2),
        cause: Cause::Emergency.with(code),
    };
    desk.panel.on_event(&fault(0x7121));
    desk.panel.on_event(&fault(0x8611));
    assert_eq!(desk.get(panel::FAULT, 3), 0x0008_7121);
    assert_eq!(desk.get(panel::FAULT, 2), 0);
    // What is no matter of one axis is one of all.
    desk.panel.on_event(&GroupEvent::Fault {
        axis: None,
        cause: Cause::CyclesLate.with(3),
    });
    assert_eq!(desk.get(panel::FAULT, 3), 0x0008_7121);
    assert_eq!(desk.get(panel::FAULT, 2), 0x000F_0003);
    desk.panel.on_event(&GroupEvent::State {
        from: GroupState::Faulted,
        to: GroupState::Enabling,
    });
    assert_eq!(desk.get(panel::FAULT, 3), 0);
}

#[test]
fn a_program_is_taken_piece_by_piece() {
    let program = one_wait();
    let mut desk = Desk::new();
    let (first, second) = program.split_at(3);
    desk.write(0, first, false).unwrap();
    assert_eq!(desk.panel.program(), None);
    // Not while it is only half there.
    let standby = GroupState::Standby as u32;
    desk.refused(panel::COMMAND, 0, 12, STATE, 0xFF01_0000 | standby);
    // Nor by the button.
    let Desk { rig, panel, .. } = &mut desk;
    panel.press(&mut rig.group, &mut rig.director);
    (0..3).for_each(|_| desk.step(READY));
    assert_eq!(desk.get(panel::REFUSAL, 0) as u32, 0xFF01_0000 | standby);
    assert_eq!(desk.get(panel::STATE, 0), GroupState::Standby as i32);
    desk.write(3, second, true).unwrap();
    assert_eq!(desk.panel.program(), Some(&program[..]));
    desk.rig.program = program;
    desk.command(12);
    desk.until(GroupState::Moving);
    assert_eq!(desk.get(panel::STEP, 0), 1);
    assert_eq!(desk.write(0, &[1], true), Err(STATE));
    desk.until(GroupState::Standby);
    assert_eq!(desk.get(panel::STEP, 0), 0);
}

#[test]
fn a_program_that_cannot_be_run_is_refused() {
    let mut program = one_wait();
    let mut desk = Desk::new();
    desk.write(0, &program, true).unwrap();
    *program.last_mut().unwrap() ^= 1;
    assert_eq!(desk.write(0, &program, true), Err(VALUE));
    assert_eq!(desk.get(panel::REFUSAL, 0) as u32 >> 16, 0xFF14);
    assert_eq!(desk.panel.program(), None);
    assert_eq!(
        desk.write(0, &[0; PROGRAM_BYTES + 1], true),
        Err(AbortCode::TOO_LONG)
    );
    let long = 0xFF10_0000 | (PROGRAM_BYTES as u32 + 1);
    assert_eq!(desk.get(panel::REFUSAL, 0) as u32, long);
    desk.write(0, &[1], false).unwrap();
    desk.panel.cancel();
    assert_eq!(desk.panel.program(), None);
}
