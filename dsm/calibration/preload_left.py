"""What the stiffness of ball bearings says of their preload."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from dsm.spindle.attachments import Bearing

RADIAL_EXPONENTS = 0.27, 0.32
"""d ln k / d ln F of radial stiffness k over preload F, of angular contact ball bearings of 15 to 25 degrees."""


class PreloadLeft(NamedTuple):
    """Range in which the preload over that at the start lies (-). Printed, it says what it rests on."""

    low: float
    """The lower end."""
    high: float
    """The upper end."""

    def __str__(self) -> str:
        """For people."""
        low, high = (f"{100 * end:.2g}" if end < 0.995 else f"{100 * end:.0f}" for end in self)
        steep, flat = (1 / exponent for exponent in RADIAL_EXPONENTS)
        law = f"stiffness to the power of {flat:.1f} to {steep:.1f}"
        return f"preload left: {low} to {high} % of that at the start, if the bearings have balls (by {law}); no finer"


def preload_left(bearings: Iterable[Bearing], factor: float) -> PreloadLeft | None:
    """Range of the preload left in bearings whose radial stiffness is `factor` times that at the start (-, > 0).

    Of Jones's model at rest (T. A. Harris and M. N. Kotzalas, Rolling Bearing Analysis, 2007) the radial exponents;
    where its axial ones are those of makers' catalogues, 0.39 to 0.52 at 15 degrees and 0.35 to 0.41 at 25, they lie
    between these. Nothing finer is known without the geometry of the bearings. None without bearings or where one has
    rollers.

    >>> left = preload_left([Bearing(0.1, 2.5e8), Bearing(0.35, 2.5e8)], 0.8)
    >>> f"{left.low:.2f} to {left.high:.2f} of the preload"
    '0.44 to 0.50 of the preload'
    >>> preload_left([Bearing(0.1, 2.5e8, rolling_elements="rollers")], 0.8) is None
    True
    """
    kinds = {bearing.rolling_elements for bearing in bearings}
    if kinds != {"balls"}:
        return None
    return PreloadLeft(*sorted(factor ** (1 / exponent) for exponent in RADIAL_EXPONENTS))
