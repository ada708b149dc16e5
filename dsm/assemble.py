"""From a spindle to its dynamic stiffness matrix."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsm.dynamic_stiffness import DynamicStiffness
from dsm.element_series import MAX_X, element_series
from dsm.spindle import SAME_PLACE, Spindle

Held = tuple[float, int]
"""A dof that cannot move: position (m), and 0 for the deflection or 1 for the slope."""


def assemble(
    spindle: Spindle, top_frequency: float, places: Sequence[float] = (), held: Sequence[Held] = ()
) -> DynamicStiffness:
    """Dynamic stiffness matrix with nodes at segment ends, bearings, `places` (m) and `held` dofs.

    Elements longer than the series allows at `top_frequency` (Hz) are split into equal parts. A pinned end is
    held = [(z, 0)], a clamped one [(z, 0), (z, 1)]. Rounding blurs the matrix by the order of 1e-14 EI/l^3
    (N/m), l the shortest distance between nodes. Raises ValueError for a place off the shaft.
    """
    wanted = [bearing.position for bearing in spindle.bearings] + list(places) + [z for z, _ in held]
    position, of_segment = _nodes(spindle, wanted, top_frequency)
    rigidity, mass = (values[of_segment] for values in section_properties(spindle))
    series = element_series(rigidity, mass, np.diff(position))
    diagonal = np.zeros((3, position.size, series.shape[2]))
    diagonal[:, :-1] = series[:3]
    diagonal[:, 1:] += series[:3] * np.array([1, -1, 1])[:, np.newaxis, np.newaxis]
    coupling = np.stack([series[3], series[4], -series[4], series[5]])
    model = DynamicStiffness(position, diagonal, coupling, np.zeros((position.size, 2), dtype=bool), top_frequency)
    for bearing in spindle.bearings:
        diagonal[0, model.node(bearing.position), 0] += bearing.stiffness
    for place, dof in held:
        _hold(model, model.node(place), dof)
    return model


def section_properties(spindle: Spindle) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Bending stiffness EI (N m^2) and mass per length (kg/m) of the segments, shape (n_segments,) each."""
    rigidity = [spindle.youngs_modulus * segment.second_moment for segment in spindle.segments]
    return np.array(rigidity), np.array([spindle.density * segment.area for segment in spindle.segments])


def _nodes(
    spindle: Spindle, wanted: Sequence[float], top_frequency: float
) -> tuple[NDArray[np.float64], NDArray[np.int_]]:
    """Node positions (m), shape (n,), and the segment of each element, shape (n - 1,)."""
    ends = np.cumsum([0.0] + [segment.length for segment in spindle.segments])
    slack = SAME_PLACE * ends[-1]
    nodes = ends
    for place in wanted:
        if not -slack <= place <= ends[-1] + slack:
            raise ValueError(f"position={place} m is off the shaft, which spans 0 to {ends[-1]:g} m")
        if np.min(np.abs(nodes - place)) > slack:
            nodes = np.sort(np.append(nodes, place))
    of_segment = np.searchsorted(ends, (nodes[:-1] + nodes[1:]) / 2) - 1
    rigidity, mass = section_properties(spindle)
    x = np.diff(nodes) * ((mass / rigidity)[of_segment] * (2 * np.pi * top_frequency) ** 2) ** 0.25
    parts = np.maximum(np.ceil(x / MAX_X), 1).astype(int)
    if np.all(parts == 1):
        return nodes, of_segment
    pieces = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(nodes[:-1], nodes[1:], parts, strict=True)]
    return np.append(np.concatenate(pieces), nodes[-1]), np.repeat(of_segment, parts)


def _hold(model: DynamicStiffness, node: int, dof: int) -> None:
    """Replace row and column of a dof by those of the unit matrix, in place."""
    model.held[node, dof] = True
    model.diagonal[[2 * dof, 1], node] = 0.0
    model.diagonal[2 * dof, node, 0] = 1.0
    model.coupling[2 * dof : 2 * dof + 2, node : node + 1] = 0.0
    model.coupling[[dof, dof + 2], node - 1 : node] = 0.0
