"""What an emulated device is asked to measure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from acquisition.channel import SensorInput
from acquisition.emulation.simulated_source import Signal


@dataclass(frozen=True)
class Bench:
    """What is on the inputs of an emulated device, and how it is to be served."""

    signal_at: Callable[[float], Signal]
    """Function that makes, for a sample rate (Hz), the signal that the sensors feel."""
    inputs: tuple[SensorInput, ...]
    """The sensors, in the order of the signal's rows."""
    sample_rate: float
    """Sample rate of a device that has only one (Hz)."""
    realtime: bool = True
    """Whether it sends by the clock; False sends as fast as the host reads."""
    tcp: bool = False
    """Whether it serves a TCP port of this computer instead of a pseudo-terminal."""
    digital_clock: bool = False
    """Whether a square wave is on digital input 0."""
