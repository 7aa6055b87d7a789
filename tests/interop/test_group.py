"""canopen leads the group: releases it, moves it, stops it and watches it."""

import time

from machine import MASTER, PATIENCE, OnTheBus, await_frame, number, u32

COMMAND = 0x2000
STATE = 0x2001
REFUSAL = 0x2002
TARGET = 0x2004
VELOCITY = 0x2005
ACCELERATION = 0x2006
POSITION = 0x2009
TPDO = 0x1800

ENABLE, DISABLE, RELEASE, STOP, START, START_PROGRAM = 1, 2, 3, 4, 10, 12
IDLE, STANDBY, MOVING = 0, 2, 3
AXES = range(1, 7)
NO_AXIS = 0xFF
NOT_IN_STATE = 1
DEVICE_STATE = 0x0800_0022
VALUE = 0x0609_0030
# Increments from the target within which an axis has arrived.
NEAR = 5
TURN = 4096


def i32(data):
    return int.from_bytes(data, "little", signed=True)


class Group(OnTheBus):
    """Nobody presses the button."""

    options = ("--unattended",)

    def setUp(self):
        super().setUp()
        self.board = self.node(MASTER)
        # Nobody answers before.
        self.await_state(self.board, "OPERATIONAL")
        self.until_state(STANDBY)

    def put(self, index, sub, value):
        data = value.to_bytes(2, "little") if index == COMMAND else u32(value)
        self.board.sdo.download(index, sub, data)

    def command(self, value):
        self.put(COMMAND, 0, value)

    def state(self):
        return number(self.board.sdo.upload(STATE, 0))

    def until_state(self, wanted):
        until = time.monotonic() + PATIENCE
        state = None
        while time.monotonic() < until:
            state = self.state()
            if state == wanted:
                return
        self.fail(f"the group is in state {state}, not {wanted}")

    def positions(self):
        return [i32(self.board.sdo.upload(POSITION, axis)) for axis in AXES]

    def aim(self, target):
        for axis in AXES:
            self.put(TARGET, axis, target)
            self.put(VELOCITY, axis, 1000)
            self.put(ACCELERATION, axis, 3000)

    def until_arrived(self, targets):
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            apart = [abs(a - b) for a, b in zip(self.positions(), targets)]
            if max(apart) <= NEAR:
                return
        self.fail(f"increments from the target: {apart}")

    def test_release_move_and_stop(self):
        home = self.positions()
        self.command(RELEASE)
        self.until_state(MOVING)
        self.aim(2 * TURN)
        self.command(START)
        self.until_arrived([at + 2 * TURN for at in home])
        self.aim(0)
        self.command(START)
        self.until_arrived(home)
        self.command(STOP)
        self.until_state(STANDBY)

    def test_nothing_starts_without_a_release(self):
        self.aim(TURN)
        before = self.positions()
        self.aborts(DEVICE_STATE, self.command, START)
        why = number(self.board.sdo.upload(REFUSAL, 0))
        self.assertEqual((why >> 24, why >> 16 & 0xFF), (NO_AXIS, NOT_IN_STATE))
        self.until_arrived(before)

    def test_a_target_beyond_the_travel_is_refused_with_its_axis(self):
        self.command(RELEASE)
        self.until_state(MOVING)
        self.aim(0)
        self.put(TARGET, 3, 2**30)
        self.aborts(VALUE, self.command, START)
        why = number(self.board.sdo.upload(REFUSAL, 0))
        self.assertEqual(why >> 24, 3)
        self.command(STOP)
        self.until_state(STANDBY)

    def test_disable_and_enable(self):
        self.command(DISABLE)
        self.until_state(IDLE)
        self.command(ENABLE)
        self.until_state(STANDBY)

    def test_the_built_in_program_by_one_command(self):
        self.command(START_PROGRAM)
        self.until_state(MOVING)
        self.command(STOP)
        self.until_state(STANDBY)

    def test_the_state_comes_by_the_boards_tpdo(self):
        cob_id = number(self.board.sdo.upload(TPDO, 1))
        self.board.sdo.download(TPDO, 1, u32(cob_id & 0x7FFF_FFFF))
        self.addCleanup(self.board.sdo.download, TPDO, 1, u32(cob_id))
        bus = self.machine.bus()
        self.addCleanup(bus.shutdown)
        frame = await_frame(bus, lambda m: m.arbitration_id == cob_id & 0x7FF)
        self.assertEqual(frame.data[0], STANDBY)
