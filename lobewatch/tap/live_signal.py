"""The newest samples of a live test: its levels, and a stretch at rest."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from acquisition import Block, Device, Hit, Source
from acquisition.channel import ChannelQuantity
from acquisition.hits import TapInputs

LEVEL_TIME = 0.05
"""Length of the live levels (s)."""


def description(device: Device) -> str:
    """Model, serial number, firmware, and how it finds lost scans, as far as it says."""
    who = device.identity
    details = {"serial number ": who.serial, "firmware ": who.firmware, "loss detection: ": device.loss_detection}
    return ", ".join([who.model, *(name + value for name, value in details.items() if value)])


class LiveSignal:
    """Force and acceleration of one connected source, or the acceleration alone."""

    def __init__(self, source: Source, quantity: ChannelQuantity = "force", direction: str = "") -> None:
        """quantity: by which hits are seen; direction: the one that is tapped; DataError as `input_channels`."""
        self.inputs = TapInputs.of(source.channels, quantity, direction)
        """Inputs of the tap test: force and acceleration, or the latter alone; between them that across to it."""
        self._rate = source.sample_rate
        self._recent: deque[NDArray[np.int32]] = deque(maxlen=64)

    @property
    def levels(self) -> tuple[float | None, float]:
        """rms about the mean of force (N; None where none is measured) and acceleration (m/s^2) over LEVEL_TIME."""
        wanted = round(LEVEL_TIME * self._rate)
        newest: list[NDArray[np.int32]] = []
        for codes in reversed(self._recent):
            newest.insert(0, codes[list(self.inputs.rows)])
            if sum(part.shape[1] for part in newest) >= wanted:
                break
        steps = np.std(np.concatenate(newest, axis=1)[:, -wanted:], axis=1)
        rms = [float(step * abs(channel.scale)) for step, channel in zip(steps, self.inputs.channels, strict=True)]
        return rms[0] if len(rms) > 1 else None, rms[-1]

    def add(self, block: Block) -> None:
        """Take note of a block."""
        self._recent.append(block.codes)

    def record(self, blocks: Iterable[Block], duration: float) -> Hit:
        """The next blocks that make up a duration (s), as one record."""
        codes, lost = [], 0
        for block in blocks:
            codes.append(block.codes[list(self.inputs.rows)])
            lost += block.lost_before
            if sum(part.shape[1] for part in codes) >= duration * self._rate:
                break
        return self.inputs.hit(np.concatenate(codes, axis=1), self._rate, lost_scans=lost)


def resting_rms(baseline: Hit, width: int) -> float:
    """rms of the acceleration about its mean over `width` samples at rest, the median of all such (m/s^2)."""
    pieces = baseline.acceleration[: max(baseline.acceleration.size // width, 1) * width]
    return float(np.median(np.std(pieces.reshape(-1, min(width, pieces.size)), axis=1)))
