"""canopen as a client of the board itself: its object dictionary, heartbeat and
emergencies.

Drive 4 is missing, so that there is an emergency to see, and the board stays in
pre-operational.
"""

import contextlib
import struct

import canopen

from machine import MASTER, OnTheBus, number, u32

NAME = b"canmaster"
MISSING = 4
BOOT_FAILED = 0xFF40

HEARTBEAT = 0x1017
CONCISE_DCF = 0x1F22
CLOCK = 0x2F10

CONSTANT = 0x0601_0002
NO_SUCH_OBJECT = 0x0602_0000
NO_SUCH_SUB_INDEX = 0x0609_0011
TOO_LONG = 0x0607_0012
TOO_SHORT = 0x0607_0013
DEVICE_STATE = 0x0800_0022
CANNOT_STORE = 0x0800_0020
# Segments in a block, and bytes in a segment.
BLOCK = 127
SEGMENT = 7
# "save", as 1010h wants it.
SAVE = b"save"


def u16(value):
    return struct.pack("<H", value)


def block_read(sdo, index, sub):
    with sdo.open(index, sub, "rb", block_transfer=True) as stream:
        return stream.read()


def block_write(sdo, index, sub, data):
    with sdo.open(index, sub, "wb", block_transfer=True, size=len(data)) as stream:
        stream.write(data)


class Board(OnTheBus):
    """The board in pre-operational."""

    options = ("--without", str(MISSING))

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        # Listens from before the drive is given up.
        cls.witness = cls.machine.network()
        cls.witnessed = cls.witness.add_node(MASTER, canopen.ObjectDictionary())
        cls.machine.await_words("network not started")

    @classmethod
    def tearDownClass(cls):
        cls.witness.disconnect()
        super().tearDownClass()

    def setUp(self):
        super().setUp()
        self.board = self.node(MASTER)
        self.sdo = self.board.sdo

    def heartbeat(self):
        return number(self.sdo.upload(HEARTBEAT, 0))

    def sized_by_nobody(self, index, data):
        stream = self.sdo.open(index, 0, "wb", block_transfer=True, buffering=0)
        try:
            for start in range(0, len(data), SEGMENT):
                stream.write(data[start : start + SEGMENT])
        finally:
            # Ends a transfer that is over already.
            with contextlib.suppress(canopen.SdoAbortedError):
                stream.close()

    def test_expedited_transfer(self):
        self.assertEqual(len(self.sdo.upload(0x1000, 0)), 4)
        self.assertEqual(number(self.sdo.upload(0x1018, 0)), 4)
        self.sdo.download(HEARTBEAT, 0, u16(70))
        self.assertEqual(self.heartbeat(), 70)

    def test_segmented_transfer(self):
        self.assertEqual(self.sdo.upload(0x1008, 0), NAME)
        self.sdo.download(HEARTBEAT, 0, u16(60), force_segment=True)
        self.assertEqual(self.heartbeat(), 60)

    def test_block_transfer(self):
        self.assertEqual(block_read(self.sdo, 0x1008, 0), NAME)
        whole = block_read(self.sdo, CONCISE_DCF, 1)
        self.assertGreater(len(whole), 7 * 127 // 8)
        self.assertEqual(whole, self.sdo.upload(CONCISE_DCF, 1))
        block_write(self.sdo, HEARTBEAT, 0, u16(55))
        self.assertEqual(self.heartbeat(), 55)
        # 12:00 on the ten-thousandth day.
        block_write(self.sdo, CLOCK, 0, struct.pack("<IH", 12 * 3_600_000, 10_000))
        self.assertEqual(number(self.sdo.upload(CLOCK, 0)[4:]), 10_000)

    def test_the_concise_dcf_is_whole(self):
        # Count, then index, sub-index, size and data of each.
        data = self.sdo.upload(CONCISE_DCF, 1)
        entries, rest = number(data[:4]), data[4:]
        for _ in range(entries):
            size = number(rest[3:7])
            self.assertIn(size, (1, 2, 4))
            rest = rest[7 + size :]
        self.assertGreater(entries, 10)
        self.assertEqual(rest, b"")

    def test_what_is_refused(self):
        refused = [
            (NO_SUCH_OBJECT, 0x5FFF, 0, u32(0)),
            (NO_SUCH_SUB_INDEX, 0x1018, 9, u32(0)),
            (CONSTANT, 0x1018, 1, u32(0)),
            (CONSTANT, CONCISE_DCF, 1, u32(0)),
            (TOO_LONG, HEARTBEAT, 0, u32(50)),
            (TOO_SHORT, HEARTBEAT, 0, b"\x32"),
            (CANNOT_STORE, 0x1010, 1, b"load"),
        ]
        for code, index, sub, data in refused:
            with self.subTest(f"{index:04X}h:{sub}"):
                self.aborts(code, self.sdo.download, index, sub, data)
                self.aborts(code, self.sdo.download, index, sub, data, force_segment=True)
                self.aborts(code, block_write, self.sdo, index, sub, data)
        # The client does not tell how much it is, and sends the whole block.
        self.aborts(TOO_LONG, self.sized_by_nobody, HEARTBEAT, bytes(BLOCK * SEGMENT))
        self.assertEqual(self.sdo.upload(0x1008, 0), NAME)
        self.aborts(NO_SUCH_OBJECT, self.sdo.upload, 0x5FFF, 0)
        self.aborts(NO_SUCH_OBJECT, block_read, self.sdo, 0x5FFF, 0)

    def test_the_heartbeat_says_which_state_nmt_has_put_it_into(self):
        self.await_state(self.board, "PRE-OPERATIONAL")
        self.board.nmt.state = "STOPPED"
        self.await_state(self.board, "STOPPED")
        self.board.nmt.state = "PRE-OPERATIONAL"
        self.await_state(self.board, "PRE-OPERATIONAL")
        self.assertEqual(self.sdo.upload(0x1008, 0), NAME)

    def test_the_emergency_of_a_missing_drive_was_seen(self):
        emergency = self.await_emergency(self.witnessed, BOOT_FAILED)
        self.assertEqual(emergency.data[0], MISSING)
        self.assertNotEqual(number(self.sdo.upload(0x1001, 0)), 0)
        self.assertEqual(number(self.sdo.upload(0x1003, 1)) & 0xFFFF, BOOT_FAILED)

    def test_the_boot_up_of_each_drive_is_told(self):
        self.assertEqual(self.sdo.upload(0x2F00, MISSING), b"B")
        self.assertEqual(self.sdo.upload(0x2F00, 1), b"\0")
        self.assertIn(b"no boot-up", self.sdo.upload(0x2F01, MISSING))


class BoardAtWork(OnTheBus):
    """The board while the axes are enabled."""

    def test_it_can_be_read_but_keeps_its_beat(self):
        board = self.node(MASTER)
        self.machine.await_words("standby")
        self.assertEqual(board.sdo.upload(0x1008, 0), NAME)
        self.await_state(board, "OPERATIONAL")
        period = board.sdo.upload(0x1006, 0)
        self.aborts(DEVICE_STATE, board.sdo.download, 0x1006, 0, period)
        self.aborts(DEVICE_STATE, board.sdo.download, 0x1010, 1, SAVE)
        for _ in range(20):
            whole = block_read(board.sdo, CONCISE_DCF, 1)
        self.assertEqual(whole, board.sdo.upload(CONCISE_DCF, 1))
