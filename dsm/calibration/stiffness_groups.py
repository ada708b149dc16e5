"""Bearings and joints that are calibrated together, by the name of their group."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from dsm.modes.modes import Modes
from dsm.modes.spring_energy import spring_energy
from dsm.spindle.attachments import Bearing, Joint
from dsm.spindle.spindle import Spindle

_Float = NDArray[np.float64]
_Part = TypeVar("_Part", Bearing, Joint)


def chosen_groups(spindle: Spindle, groups: Sequence[str] | None) -> tuple[str, ...]:
    """The groups to calibrate; None: all that the spindle has, bearings first, in order of appearance.

    Raises ValueError for a group that is not there or named twice, for none, and for one with a rigid bearing.
    """
    known = tuple(dict.fromkeys(part.group for part in _parts(spindle) if part.group))
    names = known if groups is None else tuple(groups)
    listed = ", ".join(map(repr, known)) or "none"
    if not names:
        raise ValueError(f"no group of bearings or joints was named; groups of this spindle: {listed}")
    for name in names:
        if name not in known:
            raise ValueError(f"group {name!r} is none of this spindle; its groups: {listed}")
        if names.count(name) > 1:
            raise ValueError(f"group {name!r} is named {names.count(name)} times; name it once")
    for number, bearing in enumerate(spindle.bearings, 1):
        if bearing.group in names and math.isinf(bearing.stiffness):
            raise ValueError(
                f"bearing {number}: stiffness=inf cannot be calibrated; give a finite one to start from, "
                f"or leave its group {bearing.group!r} out"
            )
    return names


def scale_groups(spindle: Spindle, factors: Mapping[str, float]) -> Spindle:
    """The spindle with bearing stiffnesses, and both stiffnesses of joints, times the factor of their group."""
    joints = [
        replace(joint, rotational_stiffness=joint.rotational_stiffness * factors.get(joint.group, 1.0))
        for joint in _scaled(spindle.joints, factors)
    ]
    return replace(spindle, bearings=_scaled(spindle.bearings, factors), joints=joints)


def group_stiffness(spindle: Spindle, group: str) -> float:
    """Mean radial stiffness of the bearings and joints of a group (N/m)."""
    values = [part.stiffness for part in _parts(spindle) if part.group == group]
    return math.fsum(values) / len(values)


def group_shares(modes: Modes, groups: Sequence[str]) -> _Float:
    """Share of each group in the strain energy of each mode (-), shape (n_modes, n_groups); d ln w^2 / d ln factor."""
    radial, _, _, joints = spring_energy(modes)
    found = np.zeros((modes.frequency.size, len(groups)))
    for part, energy in zip(_parts(modes.spindle), np.hstack([radial, joints]).T, strict=True):
        if part.group in groups:
            found[:, groups.index(part.group)] += energy
    return np.asarray(found / (2 * np.pi * modes.frequency[:, np.newaxis]) ** 2)


def _parts(spindle: Spindle) -> tuple[Bearing | Joint, ...]:
    return (*spindle.bearings, *spindle.joints)


def _scaled(parts: Sequence[_Part], factors: Mapping[str, float]) -> list[_Part]:
    return [replace(part, stiffness=part.stiffness * factors.get(part.group, 1.0)) for part in parts]
