"""How much later the second input samples than the first, from one signal on both."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from acquisition import Channel, DataError, Device, MeasuredSkew, SensorPlace, measure_skew
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.known_devices import checked_rate
from lobewatch.tap.plug import sensor_place

SKEW_SECONDS = 2.0
"""Time for which a common signal is recorded (s)."""


@dataclass(frozen=True)
class SkewCheck:
    """The skew of a device, and where to enter it."""

    measured: MeasuredSkew
    """Skew of channel 1 against channel 0."""
    sample_rate: float
    """Sample rate at which it was measured (Hz)."""
    channel: Channel
    """Channel 1, with the skew that is entered."""
    place: SensorPlace | None
    """Place where the device keeps its skews; None where machine.toml does."""


def check_skew(folder: MachineFolder, port: str, device: Device, tell: Callable[[str], None]) -> SkewCheck:
    """Record a signal that is fed to both inputs of a connected device; tell: what to do, for a person."""
    if len(device.channels) != 2:
        raise DataError(
            f"a skew is that of two inputs; the DAQ has {len(device.channels)}: name two in [[daq.channel]]"
        )
    rate = checked_rate(folder, device)
    tell(f"recording {SKEW_SECONDS:g} s: both inputs joined with a T-piece, noise or taps on them")
    blocks = []
    device.start()
    for block in device.blocks():
        blocks.append(block.codes)
        if sum(codes.shape[1] for codes in blocks) >= SKEW_SECONDS * rate:
            break
    device.stop()
    first, second = np.concatenate(blocks, axis=1)
    place = sensor_place(folder.machine.daq, port)
    return SkewCheck(measure_skew(first, second, rate), rate, device.channels[1], place)
