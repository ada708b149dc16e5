"""What the stiffness of ball bearings says of their preload."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from dsm.spindle.attachments import Bearing


class PreloadLeft(NamedTuple):
    """Range in which the preload over that at the start lies (-). Printed, it says what it rests on."""

    low: float
    """The lower end."""
    high: float
    """The upper end."""

    def __str__(self) -> str:
        """For people."""
        return f"{self.low:.2g} to {self.high:.2g} of that at the start, if balls roll: (k/k0)^3 and (k/k0)^2, no finer"


def preload_left(bearings: Iterable[Bearing], factor: float) -> PreloadLeft | None:
    """Range of the preload left in bearings whose stiffness is `factor` times that at the start (-, > 0).

    (k/k0)^3 and (k/k0)^2: Hertz's point contact gives stiffness as the third root of the preload (T. A. Harris and
    M. N. Kotzalas, Rolling Bearing Analysis, 2007); makers' catalogues of angular contact bearings give exponents near
    one half. Nothing finer is known without the geometry of the bearings. None without bearings or where one has
    rollers.
    """
    kinds = {bearing.rolling_elements for bearing in bearings}
    return PreloadLeft(*sorted([factor**3, factor**2])) if kinds == {"balls"} else None
