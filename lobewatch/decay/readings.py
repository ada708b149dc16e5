"""What is known of the points of a series, for whoever watches over it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class KnownSpread(NamedTuple):
    """What is known of the scatter from point to point before any is measured."""

    percent: float = 0.0
    """Standard deviation (%)."""
    freedom: float = 0.0
    """Degrees of freedom that it is worth; 0: nothing is known."""


UNKNOWN_SCATTER = KnownSpread()
"""Nothing is known of it."""


class SeriesScatter(NamedTuple):
    """What is known of the scatter of a series beforehand."""

    alone: KnownSpread = UNKNOWN_SCATTER
    """That of one direction."""
    common: KnownSpread = UNKNOWN_SCATTER
    """That of the mean of both."""


NOTHING_KNOWN = SeriesScatter()
"""Nothing is known of it."""


@dataclass(frozen=True, eq=False)
class Readings:
    """A series, point by point."""

    y: Floats
    """Values, shape (n,)."""
    temperature: Floats | None = None
    """Temperature of the spindle (K or degC), NaN where it was not recorded, shape (n,)."""
    operators: tuple[str, ...] = ()
    """Who held the hammer, empty where nobody said so, n of them; none where that does not count."""
    other: Floats | None = None
    """Values of the other direction in the same clampings, NaN where there are none, shape (n,)."""
    known: SeriesScatter = NOTHING_KNOWN
    """What is known of its scatter beforehand."""

    def since(self, begin: int) -> Self:
        """The points from one on."""
        temperature, other = (None if values is None else values[begin:] for values in (self.temperature, self.other))
        operators = self.operators[begin:]
        return replace(self, y=self.y[begin:], temperature=temperature, operators=operators, other=other)

    @property
    def shared(self) -> NDArray[np.intp]:
        """Points that the other direction has too."""
        return np.empty(0, np.intp) if self.other is None else np.flatnonzero(np.isfinite(self.other))

    @property
    def common(self) -> Readings:
        """The means of both directions, at the points that both have."""
        at, other = self.shared, self.y if self.other is None else self.other
        temperature = None if self.temperature is None else self.temperature[at]
        operators = tuple(self.operators[i] for i in at) if self.operators else ()
        mean = (self.y[at] + other[at]) / 2
        return Readings(mean, temperature, operators, known=SeriesScatter(self.known.common))
