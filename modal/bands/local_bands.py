"""Which modes are fitted together, and on which lines."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from modal.bands.find_resonances import Resonance

CLOSE = 4.0
"""Neighbours nearer than this many times the sum of their half-widths are fitted together."""
MOST_TOGETHER = 6
"""Most resonances that are fitted together: the time of a fit grows with their square, and more of them often do not
settle."""
REACH = 8.0
"""A local band ends this many half-widths beyond its outer resonances."""
LEAST_LINES = 6
"""Lines that a local band has at least on either side, where there are as many."""


@dataclass(frozen=True)
class LocalBand:
    """Resonances that are fitted together."""

    resonances: tuple[Resonance, ...]
    """Resonances by rising frequency."""
    lines: slice
    """Place on the frequency axis."""

    @property
    def height(self) -> float:
        """Of its highest resonance (m/s/N)."""
        return max(resonance.height for resonance in self.resonances)


def local_bands(resonances: Sequence[Resonance], frequency: NDArray[np.float64]) -> list[LocalBand]:
    """Bands around close resonances; neighbouring ones meet between them, in proportion to their half-widths.

    resonances come by rising frequency, frequency (Hz) has shape (n,).
    """
    groups = [part for group in _groups(resonances) for part in _parts(group)]
    meetings = [_between(a[-1], b[0]) for a, b in pairwise(groups)]
    borders = zip(groups, [-np.inf, *meetings], [*meetings, np.inf], strict=False)
    return [LocalBand(group, _lines(group, below, above, frequency)) for group, below, above in borders]


def _groups(resonances: Sequence[Resonance]) -> Iterator[tuple[Resonance, ...]]:
    group: tuple[Resonance, ...] = ()
    for resonance in resonances:
        if group and not _are_close(group[-1], resonance):
            yield group
            group = ()
        group = (*group, resonance)
    if group:
        yield group


def _parts(group: tuple[Resonance, ...]) -> Iterator[tuple[Resonance, ...]]:
    """The group, or what is left of it when it is cut at its widest gaps until no part is too large."""
    if len(group) <= MOST_TOGETHER:
        yield group
        return
    gaps = [(b.frequency - a.frequency) / (a.half_width + b.half_width) for a, b in pairwise(group)]
    widest = int(np.argmax(gaps)) + 1
    yield from _parts(group[:widest])
    yield from _parts(group[widest:])


def _are_close(a: Resonance, b: Resonance) -> bool:
    return b.frequency - a.frequency < CLOSE * (a.half_width + b.half_width)


def _between(a: Resonance, b: Resonance) -> float:
    return (a.frequency * b.half_width + b.frequency * a.half_width) / (a.half_width + b.half_width)


def _lines(group: tuple[Resonance, ...], below: float, above: float, frequency: NDArray[np.float64]) -> slice:
    low = max(below, min(r.frequency - REACH * r.half_width for r in group))
    high = min(above, max(r.frequency + REACH * r.half_width for r in group))
    first, last = np.searchsorted(frequency, [group[0].frequency, group[-1].frequency])
    start = min(int(np.searchsorted(frequency, low)), int(first) - LEAST_LINES)
    end = max(int(np.searchsorted(frequency, high, side="right")), int(last) + LEAST_LINES + 1)
    return slice(max(start, 0), end)
