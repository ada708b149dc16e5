"""What a wrong drawing does to frequencies: each diameter is off by itself, those of a tool together too."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dsm.modes.natural_frequencies import natural_frequencies
from dsm.spindle.segment import Segment
from dsm.spindle.spindle import Spindle

_Float = NDArray[np.float64]

STEP = 1e-3
"""Relative change of a diameter by which its effect is worked out, either way."""
TOGETHER = 3.0
"""Tolerance of all diameters of a tool together over that of one of the drawing: what stands for flutes is rough."""
SHARED = -1
"""Stands for all spindles in the place of a diameter."""
Place = tuple[int, int]
"""The spindle of a segment, and its number from the rear end; 0: all that no other spindle has, together."""


def diameters(spindles: Sequence[Spindle]) -> list[list[Place]]:
    """A name for the diameters of each segment of each spindle; segments that all have at their rear are the same.

    The last name of a spindle with others, its tool, is that of all these together.
    """
    shared = 0
    for rear in zip(*(reversed(spindle.segments) for spindle in spindles), strict=False):
        if any(segment != rear[0] for segment in rear):
            break
        shared += 1
    names = []
    for number, spindle in enumerate(spindles):
        behind = range(len(spindle.segments), 0, -1)
        together = [(number, 0)] if len(behind) > shared else []
        names.append([*((SHARED, k) if k <= shared else (number, k) for k in behind), *together])
    return names


def effects(spindle: Spindle, values: Callable[[Spindle], _Float], names: Sequence[Place]) -> _Float:
    """d ln value / d ln diameter, outside and inside alike, of each of the names, shape (n_values, n_names).

    Of all diameters of a tool together it is TOGETHER times as much.
    """
    columns = []
    for number in range(len(spindle.segments)):
        low, high = (values(_with_diameter(spindle, number, 1 + side * STEP)) for side in (-1, 1))
        columns.append(np.log(high / low) / (2 * STEP))
    own = [column for column, (owner, _) in zip(columns, names, strict=False) if owner != SHARED]
    return np.array([*columns, TOGETHER * np.sum(own, axis=0)] if own else columns).T


def frequency_effects(
    spindles: Sequence[Spindle], mode: NDArray[np.int_], shaft: NDArray[np.int_], names: Sequence[Sequence[Place]]
) -> _Float:
    """Effects on modes of several spindles, shape (n_modes, n_diameters), diameters by name in order of appearance."""
    order = in_order(names)
    found = np.zeros((mode.size, len(order)))
    for number, spindle in enumerate(spindles):
        here = np.flatnonzero(shaft == number)
        columns = np.array([order[name] for name in names[number]])
        found[np.ix_(here, columns)] = effects(spindle, _frequencies(mode[here]), names[number])
    return found


def _frequencies(mode: NDArray[np.int_]) -> Callable[[Spindle], _Float]:
    """What gives the frequencies of these modes (Hz)."""
    return lambda spindle: np.asarray(natural_frequencies(spindle, int(np.max(mode)))[mode - 1])


def in_order(names: Sequence[Sequence[Place]]) -> dict[Place, int]:
    """Column of each diameter."""
    return {name: column for column, name in enumerate(dict.fromkeys(name for row in names for name in row))}


def _with_diameter(spindle: Spindle, number: int, factor: float) -> Spindle:
    segments = list(spindle.segments)
    segments[number] = _scaled(segments[number], factor)
    return replace(spindle, segments=segments)


def _scaled(segment: Segment, factor: float) -> Segment:
    def times(diameter: float | None) -> float | None:
        return None if diameter is None else factor * diameter

    return replace(
        segment,
        outer_diameter=factor * segment.outer_diameter,
        bore_diameter=factor * segment.bore_diameter,
        end_outer_diameter=times(segment.end_outer_diameter),
        end_bore_diameter=times(segment.end_bore_diameter),
        mass_diameter=times(segment.mass_diameter),
    )
