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
    """For a sample rate (Hz): what the sensors feel."""
    inputs: tuple[SensorInput, ...]
    """The sensors, in the order of the signal's rows."""
    sample_rate: float
    """Of a device that has only one (Hz)."""
    realtime: bool = True
    """False sends as fast as the host reads."""
    tcp: bool = False
    """On a TCP port of this computer instead of a pseudo-terminal."""
    digital_clock: bool = False
    """A square wave is on digital input 0."""
