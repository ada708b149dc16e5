"""A driver of a device that is on no serial port: a bench that is tapped by itself, found by name."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from types import TracebackType
from typing import Self

import numpy as np

from acquisition import (
    Block,
    Channel,
    DeviceAddress,
    DeviceError,
    DeviceIdentity,
    DeviceSettings,
    Driver,
    Event,
    HammeredStructure,
    Hammering,
    SensorDataLocation,
    Structure,
    skip_serial_probe,
)
from acquisition.emulation import quantise

RATE = 25600.0
"""The only one (Hz)."""
SCANS = 512
"""In a block."""
ADDRESS = "dummybench:left"
IDENTITY = DeviceIdentity("BENCH-1", "0007", "2.0")
CHANNELS = Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0)
STRUCTURE = Structure(np.array([1700.0]), np.array([0.03]), np.array([3e7]))


class BenchSource:
    """The bench as a source of scans."""

    loss_detection = ""
    fault = ""
    follows_clock = False
    identity = IDENTITY
    channels = CHANNELS
    sample_rate = RATE

    def __init__(self) -> None:
        self._signal = HammeredStructure(STRUCTURE, RATE, np.random.default_rng(1), Hammering())
        self.events: deque[Event] = deque()
        self._going = False

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def start(self) -> None:
        self._going = True

    def stop(self) -> None:
        self._going = False

    def close(self) -> None:
        self._going = False

    def blocks(self) -> Iterator[Block]:
        scan = 0
        while self._going:
            yield Block(scan, quantise(self._signal(scan, SCANS), CHANNELS))
            scan += SCANS


def _open(port: str, _settings: DeviceSettings) -> BenchSource:
    if port != ADDRESS:
        raise DeviceError(f"there is no bench {port}", f"Use {ADDRESS}")
    return BenchSource()


DRIVER = Driver(
    "dummybench",
    "a dummy bench",
    _open,
    skip_serial_probe,
    sensor_data=SensorDataLocation("the drawing of the bench", "gain", "skew"),
    search=lambda: [DeviceAddress(ADDRESS, IDENTITY, "bench at the window")],
)
