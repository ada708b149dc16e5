"""One cut from a device that streams: recorded from the air before it to the air after it, without a key."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition import Block, Channel, DataError, Device, DeviceError
from acquisition.files.cut_file import CutSignal
from lobewatch.cuts.listening.find_cut import CutParts, find_cuts
from lobewatch.tap.listening.cut_state import CutStep
from lobewatch.tap.live_signal import LEVEL_TIME

LOOK = 0.5
"""Time between two looks at what has been heard (s)."""
KEPT = 20.0
"""Length of the newest sound that is kept (s)."""
LONGEST = 8.0
"""Length after which a cut is judged, whether it ends or not (s)."""
AFTER = 0.3
"""Length of air that shows that a cut has ended (s)."""
BEFORE = 1.0
"""Length of air that is kept before a cut (s)."""
ALIVE = 1.0
"""Time after which it is looked at whether anything is heard at all (s)."""

BEGIN = "hearing the spindle turn in air; begin the cut"
ON_HOUSING = "The sensor on the housing, the spindle turning in air: now begin the cut."
TOO_SHORT = "too short for a word, or no air before it; cut again, a second or longer"
GO_ON = "A second or longer, then out of the cut: it is judged by itself."


@dataclass
class _Ear:
    """Sound heard so far on one channel."""

    channel: Channel
    row: int
    rate: float

    def __post_init__(self) -> None:
        self.codes: list[NDArray[np.int32]] = []
        self.marks: list[tuple[int, int]] = []
        self.count = 0
        self.heard = 0

    def add(self, block: Block) -> None:
        """Keep a block, and forget what is too old."""
        codes = block.codes[self.row]
        overloaded = bool(block.overload >> self.row & 1)
        if block.lost_before or overloaded:
            self.marks.append((self.heard, block.lost_before or -1))
        self.codes.append(codes)
        self.heard, self.count = self.heard + codes.size, self.count + codes.size
        while self.count - self.codes[0].size > KEPT * self.rate:
            self.count -= self.codes.pop(0).size

    @property
    def signal(self) -> CutSignal:
        """Sound that is kept."""
        codes, first = np.concatenate(self.codes), self.heard - self.count
        marks = [mark for place, mark in self.marks if place > first]
        lost = sum(mark for mark in marks if mark > 0)
        return CutSignal(
            np.asarray(codes * self.channel.scale, np.float64), self.rate, codes, self.channel, lost, -1 in marks
        )

    @property
    def level(self) -> float:
        """Root mean square about the mean over the newest LEVEL_TIME (m/s^2)."""
        wanted, newest = round(LEVEL_TIME * self.rate), list[NDArray[np.int32]]()
        for codes in reversed(self.codes):
            newest.insert(0, codes)
            if sum(part.size for part in newest) >= wanted:
                break
        return float(np.std(np.concatenate(newest)[-wanted:]) * abs(self.channel.scale))

    def forget(self) -> None:
        """Drop the sound heard so far, which is no use."""
        self.codes, self.count, self.marks = [self.codes[-1]], self.codes[-1].size, []


def _unseen(**_: Any) -> None:
    """Nobody looks."""


def record_cut(
    device: Device,
    turn: float,
    patience: float,
    show: Callable[[str], None],
    picture: Callable[..., None] = _unseen,
) -> CutSignal:
    """The next whole cut that a started device hears; turn: of the spindle (s), patience: until it ends (s).

    show: told what is being waited for; picture: given the fields of CutState that change. DataError without an
    accelerometer, and where no cut is heard in time; DeviceError where the sensor is dead.
    """
    ear, waiting = _ear(device), {"word": CutStep.LISTENING, "reason": ON_HOUSING}
    show(BEGIN)
    for signal in _looks(device, ear, patience, picture):
        parts = find_cuts(signal.acceleration, signal.sample_rate, turn)[-1]
        if _has_ended(parts, signal) and parts.reason:
            ear.forget()
            show(TOO_SHORT)
            waiting = {"word": CutStep.AGAIN, "reason": f"{TOO_SHORT.capitalize()}."}
            picture(**waiting, cut_seconds=None)
        elif not parts.reason and (_has_ended(parts, signal) or parts.end - parts.begin > LONGEST):
            return signal.part(max(parts.begin - BEFORE, 0.0), parts.end + AFTER)
        elif np.isfinite(parts.begin):
            picture(word=CutStep.CUTTING, reason=GO_ON, cut_seconds=parts.end - parts.begin)
        elif ear.heard >= ALIVE * ear.rate:
            picture(**waiting, cut_seconds=None)
    raise DataError(
        f"no cut was heard in {patience:g} s; begin to listen with the spindle turning in air, then cut, or give "
        "more --seconds"
    )


def _ear(device: Device) -> _Ear:
    rows = [i for i, channel in enumerate(device.channels) if channel.quantity == "acceleration"]
    if not rows:
        raise DataError("the device has no acceleration channel; plug the accelerometer in, or name it in [daq]")
    return _Ear(device.channels[rows[0]], rows[0], device.sample_rate)


def _looks(device: Device, ear: _Ear, patience: float, picture: Callable[..., None]) -> Iterator[CutSignal]:
    """Sound heard so far, again and again."""
    next_look, next_level, checked = LOOK, LEVEL_TIME, False
    for block in device.blocks():
        ear.add(block)
        seconds = ear.heard / ear.rate
        if not checked and seconds >= ALIVE:
            _check_alive(ear)
            checked = True
        if seconds >= next_level:
            next_level = seconds + LEVEL_TIME
            picture(level=ear.level, left=max(patience - seconds, 0.0))
        if seconds >= next_look:
            next_look = seconds + LOOK
            yield ear.signal
        if seconds > patience:
            return


def _check_alive(ear: _Ear) -> None:
    codes = np.concatenate(ear.codes)
    low, high = ear.channel.rails
    if np.mean((codes <= low) | (codes >= high)) > 0.5:
        raise DeviceError("the accelerometer stands at the end of its range", "is its cable open, is it powered?")
    if np.ptp(codes) == 0:
        raise DeviceError(
            "the accelerometer hears nothing at all", "is it plugged in, on the housing, and the spindle turning?"
        )


def _has_ended(parts: CutParts, signal: CutSignal) -> bool:
    return bool(np.isfinite(parts.end) and signal.seconds - parts.end > AFTER)
