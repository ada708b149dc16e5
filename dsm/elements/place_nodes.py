"""Where the nodes of a shaft are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsm.elements.element_series import MAX_X, POLE
from dsm.spindle.sections import Sections
from dsm.spindle.spindle import SAME_PLACE, Theory

MAX_ELEMENTS = 2000
"""More are refused: the work grows with their third power."""

_Float = NDArray[np.float64]
_Indices = NDArray[np.int_]


def place_nodes(
    pieces: Sections, wanted: Sequence[float], theory: Theory, top_frequency: float, spin: float | None
) -> tuple[_Float, _Indices]:
    """Node positions (m), shape (n,), and the index of the piece that each element is part of, shape (n - 1,).

    Nodes are the ends of the pieces, the `wanted` places (m) on the shaft, and what divides elements too long for the
    series at `top_frequency` (Hz); spin (rad/s) as in assemble. Raises ValueError for a place off the shaft.
    """
    ends = np.concatenate([[0.0], np.cumsum(pieces.length)])
    slack = SAME_PLACE * ends[-1]
    nodes = ends
    for place in wanted:
        if not -slack <= place <= ends[-1] + slack:
            raise ValueError(f"position={place} m is off the shaft, which spans 0 to {ends[-1]:g} m")
        if np.min(np.abs(nodes - place)) > slack:
            nodes = np.sort(np.append(nodes, place))
    piece = np.searchsorted(ends, (nodes[:-1] + nodes[1:]) / 2) - 1
    parts = _parts(pieces, piece, np.diff(nodes), theory, top_frequency, spin)
    if np.sum(parts) > MAX_ELEMENTS:
        raise ArithmeticError(
            f"{top_frequency:.4g} Hz needs more than {MAX_ELEMENTS} elements: ask for lower frequencies and modes, and "
            "look for segments far too thin or soft, and for wrong units"
        )
    if np.all(parts == 1):
        return nodes, piece
    split = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(nodes[:-1], nodes[1:], parts, strict=True)]
    return np.append(np.concatenate(split), nodes[-1]), np.repeat(piece, parts)


def _parts(
    pieces: Sections, piece: _Indices, length: _Float, theory: Theory, top_frequency: float, spin: float | None
) -> _Indices:
    """Number of equal parts of each element, for which w stays as far below its clamped frequencies as x = MAX_X.

    Dunkerley: 1/w_clamped^2 <= sum of those of bending, of shear and of rotary inertia alone.
    """
    w = 2 * np.pi * top_frequency
    bending = length**4 * (pieces.mass / pieces.rigidity)[piece] * w * w / POLE
    rest = np.zeros_like(length)
    if theory == "timoshenko":
        whirl = w * w + 2 * w * abs(spin or 0.0)
        rest = (pieces.mass / pieces.shear * w * w + pieces.rotary / pieces.rigidity * whirl)[piece]
        rest = rest * (length / np.pi) ** 2
    allowed = MAX_X**4 / POLE
    squared = (rest + np.sqrt(rest**2 + 4 * allowed * bending)) / (2 * allowed)
    return np.clip(np.ceil(np.sqrt(squared) * (1 - 1e-12)), 1, MAX_ELEMENTS + 1).astype(int)
