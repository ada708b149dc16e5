"""Groups of bearings and joints that are calibrated together."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from dsm.arrays import Floats
from dsm.modes.energy_shares import spring_energy
from dsm.modes.modes import Modes
from dsm.spindle.attachments import Bearing, Joint
from dsm.spindle.spindle import Spindle

_StiffPart = Bearing | Joint


def calibrated_parts(spindle: Spindle, group: str | None) -> list[int]:
    """Return the indices in (*bearings, *joints) of the parts with one common factor: all parts of a group.

    None: all bearings with a group; joints are excluded, as one factor cannot separate their wear from that of
    bearings. Raises ValueError if there is none, and for a rigid bearing.
    """
    if group is None:
        return calibrated_bearings(spindle)
    joints = [number for number, part in enumerate(_parts(spindle)) if part.group == group and isinstance(part, Joint)]
    if joints and not any(bearing.group == group for bearing in spindle.bearings):
        return joints
    return calibrated_bearings(spindle, group) + joints


def calibrated_bearings(spindle: Spindle, group: str | None = None) -> list[int]:
    """Return the indices (0 is the first) of the bearings of a group; None: of all bearings with a group."""
    chosen = [i for i, b in enumerate(spindle.bearings) if (b.group if group is None else b.group == group)]
    if not chosen:
        groups = ", ".join(sorted({repr(part.group) for part in _parts(spindle) if part.group})) or "none"
        wanted = "with a group" if group is None else f"of group {group!r}"
        raise ValueError(f"no bearing {wanted} to calibrate. Choose one of the groups: {groups}.")
    for index in chosen:
        _require_spring(spindle, index, "or the group '' to leave the bearing rigid")
    return chosen


def scale_parts(spindle: Spindle, chosen: Sequence[int], factor: float) -> Spindle:
    """Scale bearing stiffnesses, and both stiffnesses of joints, by a factor; see calibrated_parts."""
    parts = [_scale_part(p, factor, factor) if i in chosen else p for i, p in enumerate(_parts(spindle))]
    return _with_parts(spindle, parts)


def parts_stiffness(spindle: Spindle, chosen: Sequence[int]) -> float:
    """Return the mean radial stiffness of parts (N/m)."""
    parts = _parts(spindle)
    return math.fsum(parts[index].stiffness for index in chosen) / len(chosen)


def chosen_groups(spindles: Sequence[Spindle], groups: Sequence[str] | None) -> tuple[str, ...]:
    """Return the groups to calibrate; None: all groups of the spindles, bearings first, in order of appearance.

    Raises ValueError for a group that is unknown or named twice, for none, and for one with a rigid bearing.
    """
    known_names = tuple(dict.fromkeys(name for spindle in spindles for name in _group_names(spindle) if name))
    names = known_names if groups is None else tuple(groups)
    listed = ", ".join(map(repr, known_names)) or "none"
    if not names:
        raise ValueError(f"no group of bearings or joints given. Choose from: {listed}.")
    for name in names:
        if name not in known_names:
            raise ValueError(f"unknown group {name!r}. Choose from: {listed}.")
        if names.count(name) > 1:
            raise ValueError(f"group {name!r} is named {names.count(name)} times. Name each group once.")
    for spindle in spindles:
        for index, bearing in enumerate(spindle.bearings):
            if bearing.group in names:
                _require_spring(spindle, index, f"or leave the group {bearing.group!r} out")
    return names


def scale_groups(spindle: Spindle, factors: Mapping[str, float]) -> Spindle:
    """Scale bearing stiffnesses, and both stiffnesses of joints, by the factor of their group."""
    groups = ((part, part.group, _tilting_group(part)) for part in _parts(spindle))
    parts = [_scale_part(part, factors.get(group, 1.0), factors.get(tilting, 1.0)) for part, group, tilting in groups]
    return _with_parts(spindle, parts)


def group_stiffness(spindles: Sequence[Spindle], group: str) -> float:
    """Return the mean radial stiffness of a group (N/m), in the first of the spindles that has it.

    For a group of stiffnesses against tilting only it is their mean (N m/rad); see is_tilting.
    """
    for spindle in spindles:
        chosen = [index for index, part in enumerate(_parts(spindle)) if part.group == group]
        if chosen:
            return parts_stiffness(spindle, chosen)
        tilting = [joint.rotational_stiffness for joint in spindle.joints if joint.rotational_group == group]
        if tilting:
            return math.fsum(tilting) / len(tilting)
    raise ValueError(f"no spindle has the group {group!r}")


def is_tilting(spindles: Sequence[Spindle], group: str) -> bool:
    """Return whether a group holds stiffnesses against tilting only."""
    return all(part.group != group for spindle in spindles for part in _parts(spindle))


def group_shares(modes: Modes, groups: Sequence[str]) -> Floats:
    """Return the share of each group in the strain energy of each mode (-), shape (n_modes, n_groups).

    It is d ln w^2 / d ln factor.
    """
    energy, parts = spring_energy(modes), _parts(modes.spindle)
    shares = np.zeros((modes.frequency.size, len(groups)))
    springs = np.hstack([energy.radial, energy.shifts, energy.kinks]).T
    names = [*(part.group for part in parts), *map(_tilting_group, modes.spindle.joints)]
    for name, of_spring in zip(names, springs, strict=True):
        if name in groups:
            shares[:, groups.index(name)] += of_spring
    return np.asarray(shares / (2 * np.pi * modes.frequency[:, np.newaxis]) ** 2)


def _tilting_group(part: _StiffPart) -> str:
    """Return the group of the stiffness against tilting; that of a bearing is never scaled."""
    return (isinstance(part, Joint) and part.rotational_group) or part.group


def _group_names(spindle: Spindle) -> list[str]:
    joints = [name for joint in spindle.joints for name in (joint.group, joint.rotational_group)]
    return [*(bearing.group for bearing in spindle.bearings), *joints]


def _parts(spindle: Spindle) -> tuple[Bearing | Joint, ...]:
    return (*spindle.bearings, *spindle.joints)


def _scale_part(part: _StiffPart, factor: float, tilting: float) -> _StiffPart:
    if factor == tilting == 1.0:
        return part
    if isinstance(part, Bearing):
        return replace(part, stiffness=part.stiffness * factor)
    return replace(part, stiffness=part.stiffness * factor, rotational_stiffness=part.rotational_stiffness * tilting)


def _with_parts(spindle: Spindle, parts: Sequence[Bearing | Joint]) -> Spindle:
    bearings = [part for part in parts if isinstance(part, Bearing)]
    return replace(spindle, bearings=bearings, joints=[part for part in parts if isinstance(part, Joint)])


def _require_spring(spindle: Spindle, index: int, otherwise: str) -> None:
    """Raise ValueError for a rigid bearing, which no factor changes."""
    if math.isinf(spindle.bearings[index].stiffness):
        remedy = f"Give a finite stiffness as start value, {otherwise}."
        raise ValueError(f"bearing {index + 1}: stiffness=inf cannot be calibrated. {remedy}")
