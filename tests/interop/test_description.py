"""What `cargo xtask check` derives, in the hands of canopen and cantools."""

import os
import re
import subprocess
import unittest

import canopen
import cantools

from machine import DRIVES, LOG, MASTER, NETWORK, PATIENCE, ROOT, Machine, OnTheBus

DERIVED = ROOT / "target" / "network"
EDS = DERIVED / "main-master.eds"
DBC = DERIVED / "main.dbc"
# candump's format: (seconds) interface identifier#data
FRAME = re.compile(r"^\(([0-9.]+)\) \S+ ([0-9A-F]{3})#([0-9A-F]*)$")
FIRST_PDO, LAST_PDO = 0x181, 0x57F
OPERATION_ENABLED = (0x6F, 0x27)
# In the DBC; its own TPDOs are off until a client wants them.
BOARD = "master"
# What the RPDOs carry in profile velocity mode: those of the other modes are not sent.
PROFILE_VELOCITY = {"Target_velocity", "Profile_acceleration"}


def check():
    program = os.environ.get("CANMASTER_XTASK")
    command = [program] if program else ["cargo", "xtask"]
    subprocess.run([*command, "check", NETWORK], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)


def is_sent(message):
    """Whether it comes in a run in profile velocity mode that no client disturbs."""
    if BOARD not in message.senders:
        return True
    signals = {signal.name for signal in message.signals}
    return not signals.isdisjoint(PROFILE_VELOCITY)


class Description(OnTheBus):
    """The master of a machine that runs, described by its EDS."""

    @classmethod
    def setUpClass(cls):
        check()
        super().setUpClass()

    def setUp(self):
        super().setUp()
        self.master = canopen.RemoteNode(MASTER, str(EDS))
        self.master.sdo.RESPONSE_TIMEOUT = PATIENCE
        self.network.add_node(self.master)
        # Before that it is silent.
        self.await_state(self.master, "OPERATIONAL")

    def test_every_constant_of_the_eds_is_what_the_master_says(self):
        compared = 0
        for entry in self.master.object_dictionary.values():
            subs = [entry] if isinstance(entry, canopen.objectdictionary.ODVariable) else entry.values()
            for variable in subs:
                if variable.access_type != "const" or variable.default is None:
                    continue
                value = self.master.sdo.upload(variable.index, variable.subindex)
                self.assertEqual(variable.decode_raw(value), variable.default, variable)
                compared += 1
        self.assertGreater(compared, 100)

    def test_objects_go_by_their_names(self):
        sdo = self.master.sdo
        self.assertEqual(sdo["Communication cycle period"].raw, 10_000)
        self.assertEqual(sdo["Manufacturer device name"].raw, "canmaster")
        for drive in DRIVES:
            process = sdo[f"Process data of node {drive}"]
            self.assertIsInstance(process["Statusword"].raw, int)


class Decoded(unittest.TestCase):
    """The frames of a run that nobody disturbs."""

    def test_every_pdo_on_the_wire_has_its_signals(self):
        """Each frame has its message, and each message of the mode that runs comes."""
        check()
        machine = Machine("--seconds", "5")
        self.addCleanup(machine.stop)
        machine.process.wait(PATIENCE)
        database = cantools.database.load_file(DBC)
        wanted = {message.name for message in database.messages if is_sent(message)}
        seen = set()
        enabled = set()
        for line in LOG.read_text().splitlines():
            found = FRAME.match(line)
            if not found:
                continue
            identifier, data = int(found[2], 16), bytes.fromhex(found[3])
            if not FIRST_PDO <= identifier <= LAST_PDO:
                continue
            message = database.get_message_by_frame_id(identifier)
            self.assertEqual(message.length, len(data), line)
            signals = message.decode(data)
            seen.add(message.name)
            mask, value = OPERATION_ENABLED
            if signals.get("Statusword", 0) & mask == value:
                enabled.add(message.name)
        self.assertEqual(seen, wanted)
        self.assertEqual(enabled, {f"TPDO1_axis_{drive}" for drive in DRIVES})


if __name__ == "__main__":
    unittest.main()
