"""The simulated machine, started with its bridge, and ways onto its bus."""

import os
import re
import signal
import socket
import struct
import subprocess
import threading
import time
import unittest
from pathlib import Path

import can
import canopen

ROOT = Path(__file__).resolve().parents[2]
LOG = ROOT / "target" / "run" / "bus.log"
# Its drives send their heartbeats in operational, too, and Python keeps up with it.
NETWORK = ROOT / "networks" / "one_bus_10ms.toml"
BIT_RATE = 1_000_000
MASTER = 127
DRIVES = [1, 2, 3, 4, 5, 6]

# Seconds on the wall that anything may take on a slow computer; nothing is
# asserted about how fast it is.
PATIENCE = 60.0


class Machine:
    """A run of `cargo xtask run --bridge`."""

    def __init__(self, *options):
        program = os.environ.get("CANMASTER_XTASK")
        command = [program] if program else ["cargo", "xtask"]
        self.started = time.monotonic()
        self.process = subprocess.Popen(
            [*command, "run", "--network", NETWORK, "--bridge", "0", *options],
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.words = []
        self.port = None
        for line in self.process.stderr:
            self.words.append(line)
            if found := re.search(r"socket://127\.0\.0\.1:(\d+)", line):
                self.port = int(found[1])
                break
        if self.port is None:
            raise RuntimeError("no bridge:\n" + "".join(self.words))
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()

    def _read(self):
        for line in self.process.stderr:
            self.words.append(line)

    def await_words(self, words):
        """Waits until the run has said so."""
        until = time.monotonic() + PATIENCE
        while not any(words in line for line in self.words):
            if time.monotonic() > until or self.process.poll() is not None:
                raise RuntimeError(f"no word of `{words}`:\n" + "".join(self.words))
            time.sleep(0.05)

    def stop(self):
        """Ends the run as Ctrl-C does, and returns what it has said."""
        if self.process.poll() is None:
            if os.name == "nt":
                # There Ctrl-C goes to whole consoles only.
                self.process.terminate()
            else:
                self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()
            raise
        finally:
            self.reader.join(PATIENCE)
            self.process.stderr.close()
        return "".join(self.words)

    def bus(self):
        """python-can's way onto the bus."""
        return can.Bus(
            interface="slcan",
            channel=f"socket://127.0.0.1:{self.port}",
            bitrate=BIT_RATE,
            sleep_after_open=0,
        )

    def network(self):
        """canopen's way onto the bus."""
        network = canopen.Network(self.bus())
        network.connect()
        return network

    def socket(self):
        """A plain connection."""
        return socket.create_connection(("127.0.0.1", self.port), PATIENCE)


def await_frame(bus, wanted):
    """The next frame for which `wanted` holds."""
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        message = bus.recv(1.0)
        if message is not None and wanted(message):
            return message
    raise AssertionError("the frame never came")


class OnTheBus(unittest.TestCase):
    """Tests that share one machine; each has a connection of its own."""

    options = ()

    @classmethod
    def setUpClass(cls):
        cls.machine = Machine(*cls.options)

    @classmethod
    def tearDownClass(cls):
        cls.machine.stop()

    def setUp(self):
        self.network = self.machine.network()
        self.addCleanup(self.network.disconnect)

    def node(self, number):
        """A node of the network, of which nothing is known but its node-ID."""
        node = canopen.RemoteNode(number, canopen.ObjectDictionary())
        node.sdo.RESPONSE_TIMEOUT = PATIENCE
        self.network.add_node(node)
        return node

    def await_state(self, node, state):
        """Waits until the node's heartbeat says so."""
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            try:
                if node.nmt.wait_for_heartbeat(timeout=1.0) == state:
                    return
            except canopen.nmt.NmtError:
                continue
        self.fail(f"node {node.id} never was {state}")

    def await_emergency(self, node, code):
        """The node's first emergency with this code since it is known."""
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            for emergency in node.emcy.log:
                if emergency.code == code:
                    return emergency
            time.sleep(0.02)
        return self.fail(f"node {node.id} sent no EMCY {code:04X}h")

    def aborts(self, code, action, *arguments, **named):
        """The server refuses `action` with this abort code."""
        with self.assertRaises(canopen.SdoAbortedError) as refused:
            action(*arguments, **named)
        self.assertEqual(f"{refused.exception.code:08X}", f"{code:08X}")


def u32(value):
    return struct.pack("<I", value)


def number(data):
    return int.from_bytes(data, "little")
