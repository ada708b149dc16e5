"""Nodes of a shaft, and the beam elements between them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dsm.arrays import Flags, Floats, Indices
from dsm.elements import matrix_series
from dsm.elements.element_series import (
    FIRST_SERIES_POLE,
    MAX_ELEMENT_X,
    SERIES_TERMS,
    count_series_terms,
    element_series,
    transfer_series,
)
from dsm.spindle.sections import Sections
from dsm.spindle.segment import SAME_PLACE
from dsm.spindle.spindle import Theory


def stiffness_elements(
    shaft: Sections, theory: Theory, segment: Indices, start: Floats, end: Floats, apart: bool = False
) -> Floats:
    """Dynamic stiffness of elements as series, shape (10, n, n_terms); arguments as for transfer_series.

    With u, t of both ends the rows are k(u1,u1), k(u1,t1), k(t1,t1); k(u2,u2), k(u2,t2), k(t2,t2); k(u1,u2), k(u1,t2),
    k(t1,u2), k(t1,t2).
    """
    stiffness = np.zeros((10, segment.size, count_series_terms(apart)))
    plain = ~shaft.is_cone[segment] & (theory == "euler-bernoulli")
    if np.any(plain):
        section = shaft.at(segment[plain], start[plain])
        series = element_series(section.rigidity, section.mass, (end - start)[plain])
        mirror = np.array([1, -1, 1])[:, np.newaxis, np.newaxis]
        rows = np.concatenate([series[:3], mirror * series[:3], series[3:5], -series[4:5], series[5:]])
        stiffness[:, plain, :: SERIES_TERMS if apart else 1] = rows
    if not np.all(plain):
        rest = ~plain
        transfer = transfer_series(shaft, theory, segment[rest], start[rest], end[rest], apart)
        stiffness[:, rest] = _stiffness_from_transfer(transfer)
    return stiffness


def link_elements(
    shaft: Sections, theory: Theory, segment: Indices, start: Floats, end: Floats, apart: bool = False
) -> Floats:
    """Short elements as series that lose nothing however short they are, shape (10, n, n_terms); arguments as above.

    Unknown beside q1 = (u1, t1) are the force and the moment p at end 2: [f1; 0; f2] = [[S, -H^T, 0], [-H, -F, I],
    [0, I, 0]] [q1; p; q2], so that q2 = H q1 + F p: a rigid lever H, the flexibility F in series, the inertia in S. The
    rows are S(u,u), S(u,t), S(t,t); -F(Q,Q), -F(Q,M), -F(M,M); -H^T(u,Q), -H^T(u,M), -H^T(t,Q), -H^T(t,M).
    """
    if segment.size == 0:
        return np.zeros((10, 0, count_series_terms(apart)))
    transfer = transfer_series(shaft, theory, segment, start, end, apart)
    _, b, c, d = _split_quarters(transfer)
    lever = matrix_series.inverse(d)  # H^T
    flexibility = matrix_series.product(b, lever)
    inertia = matrix_series.product(lever, c)
    return np.stack([*_upper_triangle(inertia), *_upper_triangle(-flexibility), *_matrix_entries(-lever)])


def _stiffness_from_transfer(transfer: Floats) -> Floats:
    """Of f1 = -(Q1, M1) and f2 = (Q2, M2) with q2 = A q1 + B (Q1, M1): K11 = B^-1 A, K12 = -B^-1, K22 = D B^-1."""
    a, b, _, d = _split_quarters(transfer)
    across = matrix_series.inverse(b)
    near, far = matrix_series.product(across, a), matrix_series.product(d, across)
    return np.stack([*_upper_triangle(near), *_upper_triangle(far), *_matrix_entries(-across)])


def _split_quarters(transfer: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    return transfer[:, :2, :2], transfer[:, :2, 2:], transfer[:, 2:, :2], transfer[:, 2:, 2:]


def _matrix_entries(matrix: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    return matrix[:, 0, 0], matrix[:, 0, 1], matrix[:, 1, 0], matrix[:, 1, 1]


def _upper_triangle(matrix: Floats) -> tuple[Floats, Floats, Floats]:
    """The upper half of a symmetric matrix, the mean of the two halves."""
    return matrix[:, 0, 0], (matrix[:, 0, 1] + matrix[:, 1, 0]) / 2, matrix[:, 1, 1]


MAX_SHAFT_ELEMENTS = 1000
"""More are refused: the work grows with their third power."""
MAX_TAPER_RATIO = 1.5
"""Largest ratio of outer diameters, and of walls, of the ends of one element; steeper cones are divided."""
SHORT_ELEMENT_SHARE = 0.05
"""Elements shorter than this part of the longest allowed are links: their stiffness is beyond 1e4 of their inertia."""
MAX_LINK_SHARE = 0.4
"""Links longer than this part of the longest element would need more terms: x < 0.8, their pole is at 1.875."""


class Nodes(NamedTuple):
    """Nodes along a shaft and the elements between them."""

    position: Floats
    """Places of the nodes (m), rising, shape (n,)."""
    segment: Indices
    """Index of the segment that each element is part of, shape (n - 1,)."""
    short: Flags
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
    nodes = _part_nodes(shaft, wanted)
    segment = shaft.segment_at((nodes[:-1] + nodes[1:]) / 2)
    size = _element_size(shaft, segment, nodes, theory, top_frequency, spin)
    longest = MAX_LINK_SHARE if links else 1.0
    parts = np.ceil(size / longest * (1 - 1e-12)).clip(1, MAX_SHAFT_ELEMENTS + 1).astype(int)
    if parts.sum() > MAX_SHAFT_ELEMENTS:
        raise ArithmeticError(
            f"{top_frequency:.4g} Hz needs more than {MAX_SHAFT_ELEMENTS} elements: ask for lower frequencies and modes, "
            "and look for segments far too thin or soft, and for wrong units"
        )
    if parts.max() > 1:
        split = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(nodes[:-1], nodes[1:], parts, strict=True)]
        nodes = np.append(np.concatenate(split), nodes[-1])
    return Nodes(nodes, np.repeat(segment, parts), np.repeat(links | (size < SHORT_ELEMENT_SHARE), parts))


def _part_nodes(shaft: Sections, wanted: Sequence[float]) -> Floats:
    """Nodes at ends of segments, inside steep cones and at the wanted places; places that are the same count once."""
    ends = shaft.ends
    slack = SAME_PLACE * ends[-1]
    nodes, places = np.append(ends, _cone_nodes(shaft)), np.sort(wanted)
    off = places[~((places >= -slack) & (places <= ends[-1] + slack))]
    if off.size:
        raise ValueError(f"position={off[0]} m is off the shaft, which spans 0 to {ends[-1]:g} m")
    apart = np.abs(places[:, np.newaxis] - nodes).min(axis=1, initial=np.inf) > slack
    apart[1:] &= np.diff(places) > slack
    return np.sort(np.append(nodes, places[apart]))


def _cone_nodes(shaft: Sections) -> Floats:
    """Places (m) that divide each cone into parts of equal ratio of what changes most, outer diameter or wall."""
    places = [np.zeros(0)]
    for index in np.flatnonzero(shaft.is_cone):
        outer, end_outer, bore, end_bore = shaft.diameters[:4, index]
        ratio = max((end_outer / outer, (end_outer - end_bore) / (outer - bore)), key=lambda value: abs(np.log(value)))
        parts = int(np.ceil(abs(np.log(ratio)) / np.log(MAX_TAPER_RATIO)))
        if parts > 1:
            share = (ratio ** (np.arange(1, parts) / parts) - 1) / (ratio - 1)
            places.append(shaft.ends[index] + share * (shaft.ends[index + 1] - shaft.ends[index]))
    return np.concatenate(places)


def _element_size(
    shaft: Sections, segment: Indices, nodes: Floats, theory: Theory, top_frequency: float, spin: float | None
) -> Floats:
    """Length of each element over the longest for which w stays as far below its clamped frequencies as x = MAX_X.

    Dunkerley: 1/w_clamped^2 <= sum of those of bending, of shear and of rotary inertia alone; in a cone each with the
    softest and the heaviest of its cross-sections.
    """
    w = 2 * np.pi * top_frequency
    length = np.diff(nodes)
    ends = shaft.at(segment, np.stack([nodes[:-1], nodes[1:]]))
    mass, rigidity = ends.mass.max(axis=0), ends.rigidity.min(axis=0)
    bending = length**4 * mass / rigidity * w * w / FIRST_SERIES_POLE
    rest = np.zeros_like(length)
    if theory == "timoshenko":
        whirl = w * w + 2 * w * abs(spin or 0.0)
        rotary, shear = ends.rotary.max(axis=0), ends.shear.min(axis=0)
        rest = (mass / shear * w * w + rotary / rigidity * whirl) * (length / np.pi) ** 2
    allowed = MAX_ELEMENT_X**4 / FIRST_SERIES_POLE
    return np.asarray(np.sqrt((rest + np.sqrt(rest**2 + 4 * allowed * bending)) / (2 * allowed)))
