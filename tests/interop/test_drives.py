"""canopen as a client of the drives, beside the master.

Drive 4 is missing, so that the master leaves the others in pre-operational. In its
place there is one from the factory, which the master does not know.
"""

import struct

import canopen

from machine import MASTER, PATIENCE, OnTheBus, number, u32

# What the EPOS4 50/5 says of itself.
DEVICE_TYPE = 0x0002_0192
NAME = b"EPOS4"
VENDOR = 0x0000_00FB
PRODUCT = 0x6150_0000
REVISION = 0x0170_0000

NO_SUCH_OBJECT = 0x0602_0000
READ_ONLY = 0x0601_0002
COMMAND = 0x0504_0001
HEARTBEAT_LOST = 0x8130
# Nobody has this node-ID.
STRANGER = 100
NEW_ID = 40
# What the drive from the factory gets.
FIRST_ID = 50
# Seconds on the wall after which nobody answers to a question of fastscan.
NOBODY = 0.5


class Drives(OnTheBus):
    """SDO, heartbeat, EMCY and LSS of the drives."""

    options = ("--without", "4", "--stranger")

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        # From here on the master leaves the drives alone.
        cls.machine.await_words("network not started")

    def test_every_drive_says_what_it_is(self):
        for number_ in [1, 2, 3, 5]:
            drive = self.node(number_)
            self.await_state(drive, "PRE-OPERATIONAL")
            self.assertEqual(number(drive.sdo.upload(0x1000, 0)), DEVICE_TYPE)
            self.assertEqual(drive.sdo.upload(0x1008, 0), NAME)
            self.assertEqual(number(drive.sdo.upload(0x1018, 1)), VENDOR)
            self.assertEqual(number(drive.sdo.upload(0x1018, 2)), PRODUCT)

    def test_a_drive_refuses_what_it_does_not_have(self):
        drive = self.node(1)
        self.await_state(drive, "PRE-OPERATIONAL")
        self.aborts(NO_SUCH_OBJECT, drive.sdo.upload, 0x5FFF, 0)
        self.aborts(READ_ONLY, drive.sdo.download, 0x1018, 1, u32(1))
        self.aborts(COMMAND, drive.sdo.open, 0x1008, 0, "rb", block_transfer=True)

    def test_what_is_written_is_read_again(self):
        drive = self.node(2)
        self.await_state(drive, "PRE-OPERATIONAL")
        drive.sdo.download(0x607F, 0, u32(1234))
        self.assertEqual(number(drive.sdo.upload(0x607F, 0)), 1234)

    def test_the_masters_heartbeat_comes(self):
        self.node(MASTER).nmt.wait_for_heartbeat(timeout=PATIENCE)

    def test_a_drive_that_misses_a_heartbeat_says_so(self):
        drive = self.node(3)
        self.await_state(drive, "PRE-OPERATIONAL")
        drive.sdo.download(0x1016, 2, struct.pack("<HBB", 200, STRANGER, 0))
        self.network.send_message(0x700 + STRANGER, b"\x05")
        emergency = self.await_emergency(drive, HEARTBEAT_LOST)
        self.assertEqual(emergency.register, number(drive.sdo.upload(0x1001, 0)))

    def test_a_drive_gets_its_node_id_by_lss(self):
        drive = self.node(6)
        self.await_state(drive, "PRE-OPERATIONAL")
        address = [number(drive.sdo.upload(0x1018, sub)) for sub in (1, 2, 3, 4)]
        drive.nmt.state = "STOPPED"
        self.await_state(drive, "STOPPED")
        lss = self.network.lss
        lss.RESPONSE_TIMEOUT = PATIENCE
        self.assertTrue(lss.send_switch_state_selective(*address))
        self.assertEqual(lss.inquire_node_id(), 6)
        self.assertEqual(lss.inquire_lss_address(0x5D), address[3])
        with self.assertRaises(canopen.lss.LssError):
            lss.configure_node_id(128)
        lss.configure_node_id(NEW_ID)
        lss.store_configuration()
        lss.send_switch_state_global(lss.WAITING_STATE)
        renamed = self.node(NEW_ID)
        drive.nmt.state = "RESET COMMUNICATION"
        renamed.nmt.wait_for_bootup(timeout=PATIENCE)
        self.assertEqual(number(renamed.sdo.upload(0x1018, 4)), address[3])

    def test_a_drive_from_the_factory_is_found_and_gets_its_node_id_by_lss(self):
        # The master looked for drive 4 and has left this one alone.
        self.machine.await_words("stays without node-ID")
        lss = self.network.lss
        lss.RESPONSE_TIMEOUT = NOBODY
        found, address = lss.fast_scan()
        self.assertTrue(found)
        self.assertEqual(address[:3], [VENDOR, PRODUCT, REVISION])
        lss.RESPONSE_TIMEOUT = PATIENCE
        self.assertEqual(lss.inquire_node_id(), 0xFF)
        lss.configure_bit_timing(0)
        lss.configure_node_id(FIRST_ID)
        lss.store_configuration()
        drive = self.node(FIRST_ID)
        lss.send_switch_state_global(lss.WAITING_STATE)
        drive.nmt.wait_for_bootup(timeout=PATIENCE)
        self.assertEqual(drive.sdo.upload(0x1008, 0), NAME)
        self.assertEqual(number(drive.sdo.upload(0x1018, 4)), address[3])
        drive.sdo.download(0x1017, 0, struct.pack("<H", 100))
        self.await_state(drive, "PRE-OPERATIONAL")
        lss.RESPONSE_TIMEOUT = NOBODY
        self.assertFalse(lss.fast_scan()[0], "nobody is left")
