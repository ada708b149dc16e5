"""Which parts of a model share a factor: the more modes are known, the fewer."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from dsm import Spindle

Grouping = Callable[[Spindle], Spindle]
"""The same spindle with other groups."""


def grouping_for(spindle: Spindle, modes: int) -> Grouping:
    """The finest one that needs no more factors than there are modes; two at least are needed."""
    return next((grouping for grouping in (divided, as_named) if len(_groups(grouping(spindle))) <= modes), merged)


def start_factors(spindle: Spindle, bearings: float, radial: float, tilting: float) -> list[float]:
    """A factor for each group, bearings first, in order of appearance; both of a joint that has one: the middle."""
    springs = [(bearing.group, bearings) for bearing in spindle.bearings]
    for joint in spindle.joints:
        alone = [(joint.group, radial), (joint.rotational_group, tilting)]
        springs += alone if joint.rotational_group else [(joint.group, math.sqrt(radial * tilting))]
    return list({name: factor for name, factor in springs if name}.values())


def divided(spindle: Spindle) -> Spindle:
    """The same with a group of its own for the stiffness of each joint against tilting."""
    return replace(
        spindle,
        joints=[
            replace(joint, rotational_group=joint.rotational_group or f"{joint.group} tilting")
            if joint.group
            else joint
            for joint in spindle.joints
        ],
    )


def as_named(spindle: Spindle) -> Spindle:
    """The same: groups as machine.toml has them."""
    return spindle


def merged(spindle: Spindle) -> Spindle:
    """The same with one group for all bearings that are calibrated and one for all joints."""
    return replace(
        spindle,
        bearings=[replace(bearing, group="bearings" if bearing.group else "") for bearing in spindle.bearings],
        joints=[replace(joint, group="joint" if joint.group else "", rotational_group="") for joint in spindle.joints],
    )


def _groups(spindle: Spindle) -> set[str]:
    joints = {name for joint in spindle.joints for name in (joint.group, joint.rotational_group)}
    return ({bearing.group for bearing in spindle.bearings} | joints) - {""}
