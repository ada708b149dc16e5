"""From a spindle to its dynamic stiffness matrix."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dsm.elements.beam_series import beam_series
from dsm.elements.place_nodes import place_nodes
from dsm.matrix.dynamic_stiffness import DynamicStiffness
from dsm.spindle.attachments import Bearing, Joint, LumpedMass
from dsm.spindle.sections import sections
from dsm.spindle.spindle import Spindle

_Float = NDArray[np.float64]
Held = tuple[float, int]
"""A dof that cannot move: position (m), and 0 for the deflection or 1 for the slope."""


def assemble(
    spindle: Spindle,
    top_frequency: float,
    places: Sequence[float] = (),
    held: Sequence[Held] = (),
    left_out: Sequence[int] = (),
    spin: float | None = None,
) -> DynamicStiffness:
    """Dynamic stiffness matrix with nodes at segment ends, bearings, masses, joints, `places` (m) and `held` dofs.

    Elements longer than the series allows at `top_frequency` (Hz) are split into equal parts. A pinned end is
    held = [(z, 0)], a clamped one [(z, 0), (z, 1)]. left_out: bearings (0 is the first) whose nodes are there without
    their radial springs. spin (rad/s): a polynomial in w for circular whirl, see DynamicStiffness. Rounding blurs the
    matrix by the order of 1e-14 EI/l^3 (N/m), l the shortest distance between nodes. The same one is not made twice.
    Raises ValueError for a place off the shaft.
    """
    return _assemble(spindle, float(top_frequency), tuple(map(float, places)), tuple(held), tuple(left_out), spin)


@lru_cache(maxsize=32)
def _assemble(
    spindle: Spindle,
    top_frequency: float,
    places: tuple[float, ...],
    held: tuple[Held, ...],
    left_out: tuple[int, ...],
    spin: float | None,
) -> DynamicStiffness:
    wanted = [*_places_of_parts(spindle), *places, *(z for z, _ in held)]
    pieces = sections(spindle)
    position, piece = place_nodes(pieces, wanted, spindle.theory, top_frequency, spin)
    position, series = _with_joints(spindle, position, beam_series(spindle, pieces, piece, np.diff(position), spin))
    diagonal = np.zeros((3, position.size, series.shape[2]))
    diagonal[:, :-1] = series[:3]
    diagonal[:, 1:] += series[:3] * np.array([1, -1, 1])[:, np.newaxis, np.newaxis]
    coupling = np.stack([series[3], series[4], -series[4], series[5]])
    free = np.zeros((position.size, 2), dtype=bool)
    model = DynamicStiffness(position, diagonal, coupling, free, top_frequency, spin)
    _add_masses(model, spindle)
    for z, dof in (*_add_springs(model, spindle, left_out), *held):
        _hold(model, model.node(z), dof)
    for values in (position, diagonal, coupling, free):
        values.setflags(write=False)
    return model


def _places_of_parts(spindle: Spindle) -> list[float]:
    parts: tuple[Bearing | LumpedMass | Joint, ...] = (*spindle.bearings, *spindle.masses, *spindle.joints)
    return [part.position for part in parts]


def _with_joints(spindle: Spindle, position: _Float, series: _Float) -> tuple[_Float, _Float]:
    """Nodes and element series with an element of no length at each joint."""
    for joint in spindle.joints:
        node = int(np.argmin(np.abs(position - joint.position)))
        element = np.zeros((6, series.shape[2]))
        k, tilt = joint.stiffness, joint.rotational_stiffness
        element[:, 0] = k, 0.0, tilt, -k, 0.0, -tilt
        position = np.insert(position, node, position[node])
        series = np.insert(series, node, element, axis=1)
    return position, series


def _add_masses(model: DynamicStiffness, spindle: Spindle) -> None:
    power = 1 if model.spin is None else 2
    for body in spindle.masses:
        node = model.node(body.position)
        model.diagonal[0, node, power] -= body.mass
        model.diagonal[2, node, power] -= body.diametral_inertia
        if model.spin is not None:
            model.diagonal[2, node, 1] += body.polar_inertia * model.spin


def _add_springs(model: DynamicStiffness, spindle: Spindle, left_out: Sequence[int]) -> list[Held]:
    """Add the bearings; what they hold rigidly is returned."""
    rigid: list[Held] = []
    for index, bearing in enumerate(spindle.bearings):
        node = model.node(bearing.position)
        model.diagonal[2, node, 0] += bearing.rotational_stiffness
        if index in left_out:
            continue
        if math.isinf(bearing.support_stiffness):
            rigid.append((bearing.position, 0))
        else:
            model.diagonal[0, node, 0] += bearing.support_stiffness
    return rigid


def _hold(model: DynamicStiffness, node: int, dof: int) -> None:
    """Replace row and column of a dof by those of the unit matrix, in place."""
    model.held[node, dof] = True
    model.diagonal[[2 * dof, 1], node] = 0.0
    model.diagonal[2 * dof, node, 0] = 1.0
    model.coupling[2 * dof : 2 * dof + 2, node : node + 1] = 0.0
    model.coupling[[dof, dof + 2], node - 1 : node] = 0.0
