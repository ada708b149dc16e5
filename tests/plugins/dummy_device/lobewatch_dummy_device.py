"""A driver in a package of its own: a device with three commands, and its emulator.

Commands are lines: `who` is answered by a line, `go` begins the stream, `halt` ends it; all others are not heeded. The
stream is made of packets: MARK, u32 index of the first scan, 256 scans of force and acceleration, i16, little-endian.
"""

from __future__ import annotations

import struct
import time
from collections import deque
from collections.abc import Iterator
from types import TracebackType
from typing import Self

import numpy as np

from acquisition import (
    Block,
    Channel,
    DeviceError,
    DeviceIdentity,
    DeviceSettings,
    Driver,
    EmulationSetup,
    EmulatorThread,
    Event,
    SensorDataLocation,
)
from acquisition.emulation import quantise
from acquisition.ports import SerialLink

RATE = 25600.0
"""The only one (Hz)."""
SCANS = 256
"""In a packet."""
MARK = b"\x7fDUM"
HEADER = struct.Struct("<4sI")
PACKET = HEADER.size + SCANS * 4
"""Bytes."""


class DummySource:
    """A dummy device as a source of scans."""

    loss_detection = "scan numbers"
    fault = ""

    def __init__(self, port: str) -> None:
        self._link = SerialLink(port)
        self.events: deque[Event] = deque()
        words = ask(self._link)
        if words is None:
            self._link.close()
            raise DeviceError(f"no dummy device answers on {port}", "check that it is switched on")
        self.identity = DeviceIdentity(*words[:3])
        self.follows_clock = words[3] == "clock"
        self.sample_rate = RATE
        self.channels = Channel("force", float(words[4]), 5.0), Channel("acceleration", float(words[5]), 5.0)
        self._going = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def start(self) -> None:
        self._link.write(b"go\n")
        self._going = True

    def stop(self) -> None:
        self._going = False
        self._link.write(b"halt\n")
        while self._link.read(0.2):
            pass

    def close(self) -> None:
        try:
            self._link.write(b"halt\n")
        except DeviceError:
            pass
        finally:
            self._link.close()

    def blocks(self) -> Iterator[Block]:
        received, expected = b"", 0
        while self._going:
            data = self._link.read(3.0)
            if not data:
                raise DeviceError("the dummy device has sent no samples for 3 s", "Switch it off and on")
            *packets, received = packets_in(received + data)
            for packet in packets:
                _, first = HEADER.unpack_from(packet)
                codes = np.frombuffer(packet[HEADER.size :], "<i2").reshape(-1, 2).T.astype(np.int32)
                yield Block(first, codes, lost_before=first - expected)
                expected = first + SCANS


def packets_in(received: bytes) -> Iterator[bytes]:
    """Whole packets, then the remainder."""
    start = max(received.find(MARK), 0)
    while len(received) - start >= PACKET:
        yield received[start : start + PACKET]
        start = max(received.find(MARK, start + PACKET), start + PACKET)
    yield received[start:]


def ask(link: SerialLink) -> list[str] | None:
    """Model, serial number, firmware, "clock" or "free", and both sensitivities; None where no dummy answers."""
    link.write(b"\nwho\n")  # the line before ends what another driver has left half said
    received = b""
    while data := link.read(0.5):
        received += data
        for line in received.decode("ascii", "replace").splitlines():
            if line.startswith("dummy ") and len(words := line.split()) == 7:
                return words[1:]
    return None


class DummyEmulator(EmulatorThread):
    """A dummy device made of software."""

    def __init__(self, bench: EmulationSetup) -> None:
        super().__init__(bench.tcp)
        self._signal = bench.signal_at(RATE)
        self._channels = tuple(one.channel for one in bench.inputs)
        self._realtime = bench.realtime
        self._received = b""
        self._going, self._started, self._scan, self._clock = False, 0.0, 0, 0

    def serve_once(self) -> bool:
        """See EmulatorThread."""
        *lines, self._received = (self._received + self.wire.exchange(0.002)).split(b"\n")
        for line in lines:
            self._obey(line)
        while self._going and self._due():
            codes = quantise(self._signal(self._clock, SCANS), self._channels)
            self.wire.pending += HEADER.pack(MARK, self._scan) + codes.T.astype("<i2").tobytes()
            self._scan += SCANS
            self._clock += SCANS
        return True

    def _due(self) -> bool:
        if not self._realtime:
            return len(self.wire.pending) < 1 << 16
        return self._scan + SCANS <= (time.monotonic() - self._started) * RATE

    def _obey(self, line: bytes) -> None:
        if line == b"who":
            sensitivities = " ".join(f"{channel.sensitivity:g}" for channel in self._channels)
            clock = "clock" if self._realtime else "free"
            self.wire.pending += f"dummy DUMMY-1 0042 1.0 {clock} {sensitivities}\n".encode()
        elif line == b"go":
            self._going, self._started, self._scan = True, time.monotonic(), 0
        elif line == b"halt":
            self._going = False


def _open(port: str, _settings: DeviceSettings) -> DummySource:
    return DummySource(port)


def _probe(link: SerialLink) -> DeviceIdentity | None:
    words = ask(link)
    return DeviceIdentity(*words[:3]) if words else None


def _check(settings: DeviceSettings) -> None:
    if settings.sample_rate not in (None, RATE):
        raise ValueError(f"sample_rate_hz={settings.sample_rate:g} is not {RATE:g}, the only rate of a dummy device")


DRIVER = Driver(
    "dummy",
    "a dummy device",
    _open,
    _probe,
    _check,
    SensorDataLocation("the memory of the dummy", "gain", "skew"),
    usb_vendors=frozenset({0xD0D0}),
    emulate=DummyEmulator,
    emulates_fast=True,
)
