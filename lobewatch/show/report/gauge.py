"""A gauge of how far a frequency has fallen, on the scale of the limits: one look tells 0.15 % from 10 %."""

from __future__ import annotations

from typing import NamedTuple

WIDE = 120.0
"""Width of the scale, which ends a quarter beyond the alarm (units of the picture)."""
BEYOND = 1.25


class Gauge(NamedTuple):
    """Lengths in units of the picture."""

    text: str
    """The fall in words, with its limits."""
    length: float
    """Length of the bar."""
    warn: float
    """Place of the warning."""
    alarm: float
    """Place of the alarm."""


def gauge(fall: float, warn: float, alarm: float) -> Gauge:
    """The gauge of a fall, with the limits of it (%); of a rise it is empty."""
    scale = WIDE / (BEYOND * alarm)
    text = f"frequency {-fall:+z.2f} %; warning at -{warn:g} %, alarm at -{alarm:g} %"
    return Gauge(text, min(max(fall, 0.0) * scale, WIDE), warn * scale, alarm * scale)
