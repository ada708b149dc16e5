"""Driver of the ACME-1: it answers `?` with model and serial number. `go` starts its packets, `halt` stops them."""

import struct
import time
from collections import deque
from contextlib import suppress

import numpy as np

from acquisition import Block, Channel, DeviceError, DeviceIdentity, Driver, EmulatorThread, SensorDataLocation
from acquisition.emulation import quantise
from acquisition.ports import SerialLink

RATE = 25600.0  # scans a second
SCANS = 128  # in a packet: number of its first scan (u32), then force and acceleration of each scan (i16)
SIZE = 4 + 4 * SCANS  # of a packet, bytes
CHANNELS = Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0)  # V/N, V/(m/s^2), rails at +-5 V


def probe(link):
    """Return the identity of an ACME-1 on an open port, or None."""
    link.write(b"\n?\n")  # the first line end closes an unfinished command of another driver
    received = b""
    while b"\n" not in received and (data := link.read(0.5)):
        received += data
    words = received.decode("ascii", "replace").split()
    return DeviceIdentity(*words) if len(words) == 2 and words[0] == "ACME-1" else None


class Acme:
    """A connected ACME-1: an `acquisition.Device`."""

    follows_clock = True
    loss_detection = "scan numbers"
    fault = ""

    def __init__(self, port, settings):
        self._link = SerialLink(port)
        identity = probe(self._link)
        if identity is None:
            self._link.close()
            raise DeviceError(f"no ACME-1 answers on {port}", "Check that it is switched on")
        self.identity, self.channels, self.sample_rate = identity, CHANNELS, RATE
        self.events = deque()

    def start(self):
        self._link.write(b"go\n")
        self._going = True

    def stop(self):
        self._going = False
        self._link.write(b"halt\n")
        while self._link.read(0.2):
            pass

    def blocks(self):
        received, expected = b"", 0
        while self._going:
            data = self._link.read(3.0)
            if not data:
                raise DeviceError("the ACME-1 has sent nothing for 3 s", "Switch it off and on")
            received += data
            while len(received) >= SIZE:
                first, *codes = struct.unpack(f"<I{2 * SCANS}h", received[:SIZE])
                received = received[SIZE:]
                yield Block(first, np.array(codes, np.int32).reshape(-1, 2).T, lost_before=first - expected)
                expected = first + SCANS

    def close(self):
        with suppress(DeviceError):  # it may be unplugged
            self.stop()
        self._link.close()

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.close()


class AcmeEmulator(EmulatorThread):
    """Emulated ACME-1."""

    def __init__(self, bench):
        super().__init__(bench.tcp)
        self._signal = bench.signal_at(RATE)
        self._begun, self._scan, self._taken = None, 0, 0

    def serve_once(self):
        for line in self.wire.exchange(0.002).split(b"\n"):
            if line == b"?":
                self.wire.pending += b"ACME-1 EMULATED\n"
            elif line == b"go":
                self._begun, self._scan = time.monotonic(), 0
            elif line == b"halt":
                self._begun = None
        while self._begun is not None and self._scan + SCANS <= (time.monotonic() - self._begun) * RATE:
            codes = quantise(self._signal(self._taken, SCANS), CHANNELS)  # force and acceleration of hammer hits
            self.wire.pending += struct.pack("<I", self._scan) + codes.T.astype("<i2").tobytes()
            self._scan, self._taken = self._scan + SCANS, self._taken + SCANS
        return True


DRIVER = Driver(
    "acme",
    "an ACME-1",
    open=Acme,
    probe=probe,
    sensor_data=SensorDataLocation("the settings of the ACME-1", "sensitivity", "skew"),
    emulate=AcmeEmulator,
)
