"""Where the nodes of a shaft are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsm.elements.element_series import MAX_X, POLE
from dsm.spindle.places import SAME_PLACE
from dsm.spindle.sections import Sections
from dsm.spindle.spindle import Theory

MAX_ELEMENTS = 1000
"""More are refused: the work grows with their third power."""
MOST_TAPER = 1.5
"""Largest ratio of outer diameters, and of walls, of the ends of one element; steeper cones are divided."""
SHORT = 0.05
"""Elements shorter than this part of the longest allowed are links: their stiffness is beyond 1e4 of their inertia."""
LONGEST_LINK = 0.4
"""Links longer than this part of the longest element would need more terms: x < 0.8, their pole is at 1.875."""

_Float = NDArray[np.float64]
_Indices = NDArray[np.int_]


class Nodes(NamedTuple):
    """Nodes along a shaft and the elements between them."""

    position: _Float
    """Places of the nodes (m), rising, shape (n,)."""
    segment: _Indices
    """Index of the segment that each element is part of, shape (n - 1,)."""
    short: NDArray[np.bool_]
    """Whether an element is so short that stiffness alone would drown all else in rounding, shape (n - 1,)."""


def place_nodes(
    shaft: Sections,
    wanted: Sequence[float],
    theory: Theory,
    top_frequency: float,
    spin: float | None,
    links: bool = False,
) -> Nodes:
    """Nodes at the ends of segments and the `wanted` places (m), and what divides elements that are too long.

    Too long for the series at `top_frequency` (Hz), or for the steepness of a cone; spin (rad/s) and links as in
    assemble. Raises ValueError for a place off the shaft, ArithmeticError for too many elements.
    """
    nodes = _at_parts(shaft, wanted)
    segment = shaft.segment_at((nodes[:-1] + nodes[1:]) / 2)
    size = _size(shaft, segment, nodes, theory, top_frequency, spin)
    longest = LONGEST_LINK if links else 1.0
    parts = np.ceil(size / longest * (1 - 1e-12)).clip(1, MAX_ELEMENTS + 1).astype(int)
    if parts.sum() > MAX_ELEMENTS:
        raise ArithmeticError(
            f"{top_frequency:.4g} Hz needs more than {MAX_ELEMENTS} elements: ask for lower frequencies and modes, "
            "and look for segments far too thin or soft, and for wrong units"
        )
    if parts.max() > 1:
        split = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(nodes[:-1], nodes[1:], parts, strict=True)]
        nodes = np.append(np.concatenate(split), nodes[-1])
    return Nodes(nodes, np.repeat(segment, parts), np.repeat(links | (size < SHORT), parts))


def _at_parts(shaft: Sections, wanted: Sequence[float]) -> _Float:
    """Nodes at ends of segments, inside steep cones and at the wanted places; places that are the same count once."""
    ends = shaft.ends
    slack = SAME_PLACE * ends[-1]
    nodes, places = np.append(ends, _inside_cones(shaft)), np.sort(wanted)
    off = places[~((places >= -slack) & (places <= ends[-1] + slack))]
    if off.size:
        raise ValueError(f"position={off[0]} m is off the shaft, which spans 0 to {ends[-1]:g} m")
    apart = np.abs(places[:, np.newaxis] - nodes).min(axis=1, initial=np.inf) > slack
    apart[1:] &= np.diff(places) > slack
    return np.sort(np.append(nodes, places[apart]))


def _inside_cones(shaft: Sections) -> _Float:
    """Places (m) that divide each cone into parts of equal ratio of what changes most, outer diameter or wall."""
    places = [np.zeros(0)]
    for index in np.flatnonzero(shaft.is_cone):
        outer, end_outer, bore, end_bore = shaft.diameters[:4, index]
        ratio = max((end_outer / outer, (end_outer - end_bore) / (outer - bore)), key=lambda value: abs(np.log(value)))
        parts = int(np.ceil(abs(np.log(ratio)) / np.log(MOST_TAPER)))
        if parts > 1:
            share = (ratio ** (np.arange(1, parts) / parts) - 1) / (ratio - 1)
            places.append(shaft.ends[index] + share * (shaft.ends[index + 1] - shaft.ends[index]))
    return np.concatenate(places)


def _size(
    shaft: Sections, segment: _Indices, nodes: _Float, theory: Theory, top_frequency: float, spin: float | None
) -> _Float:
    """Length of each element over the longest for which w stays as far below its clamped frequencies as x = MAX_X.

    Dunkerley: 1/w_clamped^2 <= sum of those of bending, of shear and of rotary inertia alone; in a cone each with the
    softest and the heaviest of its cross-sections.
    """
    w = 2 * np.pi * top_frequency
    length = np.diff(nodes)
    ends = shaft.at(segment, np.stack([nodes[:-1], nodes[1:]]))
    mass, rigidity = ends.mass.max(axis=0), ends.rigidity.min(axis=0)
    bending = length**4 * mass / rigidity * w * w / POLE
    rest = np.zeros_like(length)
    if theory == "timoshenko":
        whirl = w * w + 2 * w * abs(spin or 0.0)
        rotary, shear = ends.rotary.max(axis=0), ends.shear.min(axis=0)
        rest = (mass / shear * w * w + rotary / rigidity * whirl) * (length / np.pi) ** 2
    allowed = MAX_X**4 / POLE
    return np.asarray(np.sqrt((rest + np.sqrt(rest**2 + 4 * allowed * bending)) / (2 * allowed)))
