"""Nodes of a shaft, and the beam elements between them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dsm.arrays import Flags, Floats, Indices
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


class Nodes(NamedTuple):
    """Nodes along a shaft and the elements between them."""

    position: Floats
    """Positions of the nodes (m), rising, shape (n,)."""
    segment: Indices
    """Index of the segment of each element, shape (n - 1,)."""
    short: Flags
    """True for each element that is a link, as its stiffness would lose all else to rounding, shape (n - 1,)."""


def beam_elements(shaft: Sections, theory: Theory, nodes: Nodes, apart: bool) -> Floats:
    """Return all elements as series, shape (10, n, n_terms); theory and apart as for transfer_series.

    With u, t of both ends the rows are k(u1,u1), k(u1,t1), k(t1,t1); k(u2,u2), k(u2,t2), k(t2,t2); k(u1,u2), k(u1,t2),
    k(t1,u2), k(t1,t2), those of a short element as in _link_rows.
    """
    start, end = nodes.position[:-1], nodes.position[1:]
    series = np.zeros((10, start.size, count_series_terms(apart)))
    plain = ~nodes.short & ~shaft.is_cone[nodes.segment] & (theory == "euler-bernoulli")
    if np.any(plain):
        section = shaft.at(nodes.segment[plain], start[plain])
        rows = element_series(section.rigidity, section.mass, (end - start)[plain])
        mirror = np.array([1, -1, 1])[:, np.newaxis, np.newaxis]
        rows = np.concatenate([rows[:3], mirror * rows[:3], rows[3:5], -rows[4:5], rows[5:]])
        series[:, plain, :: SERIES_TERMS if apart else 1] = rows
    for chosen, rows_of in ((~nodes.short & ~plain, _stiffness_rows), (nodes.short, _link_rows)):
        if np.any(chosen):
            transfer = transfer_series(shaft, theory, nodes.segment[chosen], start[chosen], end[chosen], apart)
            far = np.ascontiguousarray(transfer.transpose(1, 2, 3, 0))
            series[:, chosen] = rows_of(far[:2, :2], far[:2, 2:], far[2:, :2], far[2:, 2:]).swapaxes(1, 2)
    return series


def _stiffness_rows(a: Floats, b: Floats, _: Floats, d: Floats) -> Floats:
    """Return the stiffness rows from q2 = A q1 + B (Q1, M1): K11 = B^-1 A, K12 = -B^-1, K22 = D B^-1.

    End forces are f1 = -(Q1, M1) and f2 = (Q2, M2).
    """
    across = _invert_series(b)
    return _matrix_rows(_multiply_series(across, a), _multiply_series(d, across), -across)


def _link_rows(_: Floats, b: Floats, c: Floats, d: Floats) -> Floats:
    """Return rows of short elements without loss of digits.

    Further unknowns besides q1 = (u1, t1) are the force and the moment p at end 2: [f1; 0; f2] = [[S, -H^T, 0],
    [-H, -F, I], [0, I, 0]] [q1; p; q2], so that q2 = H q1 + F p: a rigid lever H, the flexibility F in series, the
    inertia in S. The rows are S(u,u), S(u,t), S(t,t); -F(Q,Q), -F(Q,M), -F(M,M); -H^T(u,Q), -H^T(u,M), -H^T(t,Q),
    -H^T(t,M).
    """
    lever = _invert_series(d)  # H^T
    return _matrix_rows(_multiply_series(lever, c), -_multiply_series(b, lever), -lever)


def _matrix_rows(first: Floats, second: Floats, across: Floats) -> Floats:
    """Return the upper halves of two symmetric matrices, the means of both halves, and all entries of a third.

    Power series of 2 x 2 matrices have the shape (2, 2, n_terms, n), rows the shape (10, n_terms, n).
    """
    halves = [(m[0, 0], (m[0, 1] + m[1, 0]) / 2, m[1, 1]) for m in (first, second)]
    return np.stack([*halves[0], *halves[1], *across[0], *across[1]])


def _multiply_series(a: Floats, b: Floats) -> Floats:
    """Multiply power series of 2 x 2 matrices, cut off after n_terms."""
    series = np.zeros_like(b)
    for power in np.flatnonzero(a.any(axis=(0, 1, 3))):
        series[:, :, power:] += _multiply(a[:, :, power, np.newaxis], b[:, :, : b.shape[2] - power])
    return series


def _invert_series(a: Floats) -> Floats:
    """Invert a power series of 2 x 2 matrices whose term 0 has an inverse."""
    (p, q), (r, s) = a[:, :, :1]
    inverted = np.array([[s, -q], [-r, p]]) / (p * s - q * r)
    series, remainder = np.zeros_like(a), np.zeros_like(a)
    remainder[0, 0, 0] = remainder[1, 1, 0] = 1.0
    for power in range(a.shape[2]):
        if not np.any(remainder[:, :, power]):
            continue
        series[:, :, power, np.newaxis] = _multiply(inverted, remainder[:, :, power, np.newaxis])
        earlier = _multiply(a[:, :, 1 : a.shape[2] - power], series[:, :, power, np.newaxis])
        remainder[:, :, power + 1 :] -= earlier
    return series


def _multiply(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, :1] * b[:1] + a[:, 1:] * b[1:])


MAX_SHAFT_ELEMENTS = 1000
"""Most elements: the work grows with their third power."""
MAX_TAPER_RATIO = 1.5
"""Largest ratio of outer diameters, and of walls, at the ends of an element; steeper cones are divided."""
SHORT_ELEMENT_SHARE = 0.05
"""Length over the longest allowed below which an element is a link: its stiffness exceeds its inertia 1e4 times."""
MAX_LINK_SHARE = 0.4
"""Largest length of a link over the longest element; longer ones need more terms: x < 0.8, their pole is at 1.875."""


def place_nodes(
    shaft: Sections, wanted: Sequence[float], theory: Theory, top: float, spin: float | None, links: bool = False
) -> Nodes:
    """Place nodes at the ends of segments and the `wanted` places (m), and divide elements that are too long.

    Too long for the series at `top` (Hz), or for the steepness of a cone; spin (rad/s) and links as in
    assemble. Raises ValueError for a place off the shaft, ArithmeticError for too many elements.
    """
    nodes = _part_nodes(shaft, wanted)
    segment = shaft.segment_at((nodes[:-1] + nodes[1:]) / 2)
    size = _element_size(shaft, segment, nodes, theory, top, spin)
    longest = MAX_LINK_SHARE if links else 1.0
    parts = np.ceil(size / longest * (1 - 1e-12)).clip(1, MAX_SHAFT_ELEMENTS + 1).astype(int)
    if parts.sum() > MAX_SHAFT_ELEMENTS:
        raise ArithmeticError(
            f"{top:.4g} Hz needs more than {MAX_SHAFT_ELEMENTS} elements. Request lower frequencies or fewer modes, "
            "and check units and very thin or soft segments."
        )
    if parts.max() > 1:
        split = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(nodes[:-1], nodes[1:], parts, strict=True)]
        nodes = np.append(np.concatenate(split), nodes[-1])
    return Nodes(nodes, np.repeat(segment, parts), np.repeat(links | (size < SHORT_ELEMENT_SHARE), parts))


def _part_nodes(shaft: Sections, wanted: Sequence[float]) -> Floats:
    """Return nodes at ends of segments, inside steep cones and at the wanted places, equal places once."""
    ends = shaft.ends
    slack = SAME_PLACE * ends[-1]
    nodes, places = np.append(ends, _cone_nodes(shaft)), np.sort(wanted)
    off = places[~((places >= -slack) & (places <= ends[-1] + slack))]
    if off.size:
        raise ValueError(f"position={off[0]} m is not on the shaft (0 to {ends[-1]:g} m)")
    apart = np.abs(places[:, np.newaxis] - nodes).min(axis=1, initial=np.inf) > slack
    apart[1:] &= np.diff(places) > slack
    return np.sort(np.append(nodes, places[apart]))


def _cone_nodes(shaft: Sections) -> Floats:
    """Return places (m) that divide each cone into parts of equal ratio of outer diameter or wall."""
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
    """Return the length of each element over the longest for which w stays as far below its poles as MAX_ELEMENT_X.

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
