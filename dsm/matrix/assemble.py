"""Assemble the dynamic stiffness matrix of a spindle."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from dsm.arrays import Flags, Floats
from dsm.elements.beam_elements import beam_elements, place_nodes
from dsm.elements.element_series import combine_rotary_terms
from dsm.matrix.dynamic_stiffness import DynamicStiffness
from dsm.spindle.attachments import Bearing, Joint, LumpedMass
from dsm.spindle.sections import Sections, sections_of_segments
from dsm.spindle.segment import Material, Segment, nearest_index
from dsm.spindle.spindle import Spindle, Theory

SLOW_SPIN_SHARE = 0.25
"""Speed over the highest w below which shafts are divided alike: gyroscopic moments are small then."""
HeldDof = tuple[float, int]
"""Fixed degree of freedom: position (m), and 0 for the deflection or 1 for the slope."""
_ShaftAlone = tuple[tuple[Segment, ...], Material, Theory, tuple[Joint, ...]]


def assemble(
    spindle: Spindle,
    top_frequency: float,
    places: Sequence[float] = (),
    held: Sequence[HeldDof] = (),
    left_out: Sequence[int] = (),
    spin: float | None = None,
    links: bool = False,
) -> DynamicStiffness:
    """Assemble the matrix with nodes at segment ends, bearings, masses, joints, `places` (m) and `held` dofs.

    Elements longer than the series allows at `top_frequency` (Hz) are divided into equal parts. A pinned end is
    held = [(z, 0)], a clamped one [(z, 0), (z, 1)]. left_out: indices in (*bearings, *joints) of parts
    that are removed except for their nodes: the radial spring of a bearing, both springs of a joint. spin (rad/s): a
    polynomial in w for circular whirl, see DynamicStiffness. links: all elements are links, twice the work, for
    bearings far softer than the shaft. Matrices are cached.
    Raises ValueError for a place off the shaft.
    """
    shaft = ShaftRequest(spindle, tuple(map(float, places)), tuple(held), tuple(left_out), spin, links)
    return assemble_request(shaft, float(top_frequency))


class ShaftRequest(NamedTuple):
    """Arguments of assemble without the frequency, hashable."""

    spindle: Spindle
    places: tuple[float, ...]
    held: tuple[HeldDof, ...]
    left_out: tuple[int, ...] = ()
    spin: float | None = None
    links: bool = False


@lru_cache(maxsize=32)
def assemble_request(shaft: ShaftRequest, top_frequency: float) -> DynamicStiffness:
    """Assemble the matrix of a request, see assemble."""
    spindle, places, held, left_out, spin, links = shaft
    if spin is not None and spin < 0:  # speed and frequency change their signs together
        opposite = assemble_request(shaft._replace(spin=-spin), top_frequency)
        sign = (-1.0) ** np.arange(opposite.diagonal.shape[2])
        return replace(opposite, diagonal=sign * opposite.diagonal, coupling=sign * opposite.coupling, spin=spin)
    parts: tuple[Bearing | LumpedMass | Joint, ...] = (*spindle.bearings, *spindle.masses, *spindle.joints)
    wanted = (*(part.position for part in parts), *places, *(z for z, _ in held))
    fastest = None if spin is None else shared_spin_limit(spin, top_frequency)
    shaft_alone = tuple(spindle.segments), spindle.material, spindle.theory, tuple(spindle.joints)
    bare = _assemble_shaft(shaft_alone, wanted, top_frequency, fastest, links)
    diagonal, coupling = (
        part.copy() if spin is None else combine_rotary_terms(part, spin) for part in (bare.diagonal, bare.coupling)
    )
    held_dofs, scale = bare.held.copy(), bare.scale.copy()
    model = replace(bare, diagonal=diagonal, coupling=coupling, held=held_dofs, scale=scale, spin=spin)
    _add_masses(model, spindle)
    rigid = _add_springs(model, spindle, left_out)
    model.scale[:] = _dof_scale(model)
    for z, dof in (*rigid, *held):
        _hold_dof(model, model.node(z), dof)
    for index in left_out:
        if index >= len(spindle.bearings):  # a link without forces joins nothing
            link = model.node(spindle.joints[index - len(spindle.bearings)].position) + 1
            _hold_dof(model, link, 0)
            _hold_dof(model, link, 1)
    for values in (model.position, model.diagonal, model.coupling, model.held, model.scale):
        values.setflags(write=False)
    return model


@lru_cache(maxsize=32)
def _assemble_shaft(
    alone: _ShaftAlone, wanted: tuple[float, ...], top_frequency: float, fastest: float | None, links: bool
) -> DynamicStiffness:
    """Assemble the shaft with its joints only, common to spindles that differ in bearings and masses.

    fastest: for speeds up to that (rad/s), separate rotary terms; None: for a shaft without rotation.
    """
    segments, material, theory, joints = alone
    shaft = sections_of_segments(segments, material)
    nodes = place_nodes(shaft, wanted, theory, top_frequency, fastest, links)
    series = beam_elements(shaft, theory, nodes, apart=fastest is not None)
    position, series, short = _insert_joints(joints, nodes.position, series, nodes.short)
    return _join_elements(position, series, short, top_frequency, shaft)


def shared_spin_limit(spin: float, top_frequency: float) -> float:
    """Return a speed (rad/s) not below this one for which nodes and series are shared."""
    fastest = SLOW_SPIN_SHARE * 2 * math.pi * top_frequency
    while fastest < spin:
        fastest *= 2
    return fastest


def _insert_joints(
    joints: Sequence[Joint], position: Floats, series: Floats, short: Flags
) -> tuple[Floats, Floats, Flags]:
    """Insert a link of zero length at each joint."""
    for joint in joints:
        node = nearest_index(position, joint.position)
        link = np.zeros((10, series.shape[2]))
        link[[3, 5], 0] = -1 / joint.stiffness, -1 / joint.rotational_stiffness
        link[[6, 9], 0] = -1.0
        position = np.insert(position, node, position[node])
        series = np.insert(series, node, link, axis=1)
        short = np.insert(short, node, True)
    return position, series, short


def _join_elements(
    position: Floats, series: Floats, short: Flags, top_frequency: float, shaft: Sections
) -> DynamicStiffness:
    """Join elements, with a node of force and moment inside each link; the scale is that of the whole shaft only."""
    node = np.arange(position.size) + np.concatenate([[0], np.cumsum(short)])
    count, terms = node[-1] + 1, series.shape[2]
    diagonal, coupling = np.zeros((3, count, terms)), np.zeros((4, count - 1, terms))
    plain, link = node[:-1][~short], node[:-1][short]
    diagonal[:, node[:-1]] = series[:3]
    diagonal[:, plain + 1] += series[3:6, ~short]
    diagonal[:, link + 1] = series[3:6, short]
    coupling[:, node[:-1]] = series[6:]
    coupling[0, link + 1, 0] = coupling[3, link + 1, 0] = 1.0
    places = np.full(count, math.inf)
    places[node] = position
    held = np.zeros((count, 2), dtype=bool)
    middle = (shaft.ends[1:] + shaft.ends[:-1]) / 2
    rigidity = float(np.mean(shaft.at(np.arange(middle.size), middle).rigidity))
    length = float(shaft.ends[-1])
    scale = np.tile(1 / np.sqrt([rigidity / length**3, rigidity / length]), count)
    return DynamicStiffness(places, diagonal, coupling, held, scale, top_frequency)


def _dof_scale(model: DynamicStiffness) -> Floats:
    """Return one over the root of the stiffness, or of the flexibility, at each dof, limited by the whole shaft."""
    sizes = np.maximum(model.diagonal[::2, :, 0], model.scale[:2, np.newaxis] ** -2)
    link = np.flatnonzero(model.is_link)
    sizes[:, link] = np.maximum(-model.diagonal[::2, link, 0], 1 / sizes[:, link - 1])
    return np.asarray(1 / np.sqrt(sizes.T.ravel()))


def _add_masses(model: DynamicStiffness, spindle: Spindle) -> None:
    power = 1 if model.spin is None else 2
    for body in spindle.masses:
        node = model.node(body.position)
        model.diagonal[0, node, power] -= body.mass
        model.diagonal[2, node, power] -= body.diametral_inertia
        if model.spin is not None:
            model.diagonal[2, node, 1] += body.polar_inertia * model.spin


def _add_springs(model: DynamicStiffness, spindle: Spindle, left_out: Sequence[int]) -> list[HeldDof]:
    """Add the bearings and return the dofs of rigid ones."""
    rigid: list[HeldDof] = []
    nodes = (model.dofs(spindle.bearings) // 2).tolist()
    for index, (bearing, node) in enumerate(zip(spindle.bearings, nodes, strict=True)):
        model.diagonal[2, node, 0] += bearing.rotational_stiffness
        if index in left_out:
            continue
        if math.isinf(bearing.support_stiffness):
            rigid.append((bearing.position, 0))
        else:
            model.diagonal[0, node, 0] += bearing.support_stiffness
    return rigid


def _hold_dof(model: DynamicStiffness, node: int, dof: int) -> None:
    """Replace row and column of a dof by those of the unit matrix, in place."""
    model.held[node, dof] = True
    model.diagonal[[2 * dof, 1], node] = 0.0
    model.diagonal[2 * dof, node, 0] = 1.0
    model.coupling[2 * dof : 2 * dof + 2, node : node + 1] = 0.0
    model.coupling[[dof, dof + 2], node - 1 : node] = 0.0
    model.scale[2 * node + dof] = 1.0
