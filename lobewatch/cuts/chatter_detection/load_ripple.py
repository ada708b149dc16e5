"""Ripple of the loudness or the speed of a cut, which is no chatter."""

from typing import NamedTuple


class Ripple(NamedTuple):
    """Ripple of a cut: the same relative side bands around all multiples of tooth passing."""

    frequency: float
    """Frequency of the ripple (Hz)."""
    loudness: float
    """Amplitude of the loudness over its mean."""
    speed: float
    """Amplitude of the spindle speed over its mean."""
