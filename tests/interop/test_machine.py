"""Six drives in motion, seen by python-can and canopen."""

import itertools
import time
import unittest

import can

from machine import DRIVES, LOG, MASTER, PATIENCE, Machine, OnTheBus, await_frame, number

SYNC = 0x080
TPDO1 = 0x180
HEARTBEAT = 0x700
OPERATIONAL = b"\x05"
OPERATION_ENABLED = (0x6F, 0x27)


class Running(OnTheBus):
    """The machine moves; the tools look on."""

    def setUp(self):
        self.bus = self.machine.bus()
        self.addCleanup(self.bus.shutdown)

    def test_the_sync_is_a_data_frame_without_data(self):
        for _ in range(10):
            sync = await_frame(self.bus, lambda m: m.arbitration_id == SYNC)
            self.assertFalse(sync.is_remote_frame)
            self.assertEqual(sync.dlc, 0)

    def test_the_heartbeats_of_all_nodes_come_and_become_operational(self):
        for node in [MASTER, *DRIVES]:
            await_frame(
                self.bus,
                lambda m: m.arbitration_id == HEARTBEAT + node
                and bytes(m.data) == OPERATIONAL,
            )

    def test_every_drive_becomes_enabled(self):
        mask, value = OPERATION_ENABLED
        for node in DRIVES:
            await_frame(
                self.bus,
                lambda m: m.arbitration_id == TPDO1 + node
                and number(m.data[:2]) & mask == value,
            )

    def test_rubbish_from_one_client_disturbs_nobody(self):
        with self.machine.socket() as rubbish:
            rubbish.sendall(b"O\r" + bytes(range(256)) * 50 + b"t9999\rT\r" + b"r" * 5000)
        await_frame(self.bus, lambda m: m.arbitration_id == SYNC)
        self.assertEqual(self.bus.get_version(PATIENCE), (1, 0))

    def test_the_simulation_never_runs_ahead_of_the_clock(self):
        # Frames with their moment in simulated milliseconds.
        with self.machine.socket() as connection:
            connection.sendall(b"Z1\rO\r")
            lines = connection.makefile("rb")
            text = b""
            for _ in range(20_000):
                text += lines.read(1)
                if text.endswith(b"\r"):
                    ahead = moment(text)
                    if ahead is not None:
                        elapsed = time.monotonic() - self.machine.started
                        self.assertLessEqual(ahead, elapsed)
                    text = b""


def moment(line):
    """Seconds since power-on that the line of a data frame is stamped with; a
    minute is not exceeded in these tests."""
    if not line.startswith(b"t"):
        return None
    stamp = line[5 + 2 * int(line[4:5]) :].rstrip(b"\r")
    return int(stamp, 16) / 1000


class Log(unittest.TestCase):
    """What a run leaves behind."""

    def test_python_can_reads_every_line(self):
        machine = Machine("--seconds", "2.5")
        bus = machine.bus()
        await_frame(bus, lambda m: m.arbitration_id == HEARTBEAT + MASTER)
        own = can.Message(arbitration_id=0x7F0, data=b"hello", is_extended_id=False)
        bus.send(own)
        bus.shutdown()
        machine.process.wait(PATIENCE)
        machine.stop()
        lines = LOG.read_text().splitlines()
        frames = list(can.CanutilsLogReader(LOG))
        self.assertEqual(len(frames), len(lines))
        for earlier, later in itertools.pairwise(frames):
            self.assertLessEqual(earlier.timestamp, later.timestamp)
        sent = [f for f in frames if f.arbitration_id == own.arbitration_id]
        self.assertEqual([bytes(f.data) for f in sent], [b"hello"])
        syncs = [f for f in frames if f.arbitration_id == SYNC]
        self.assertTrue(syncs)
        self.assertTrue(all(f.dlc == 0 and not f.is_remote_frame for f in syncs))
        pdos = [f for f in frames if TPDO1 < f.arbitration_id <= TPDO1 + 0x7F]
        self.assertTrue(pdos)
        self.assertTrue(all(f.dlc == 6 for f in pdos))
