"""Simulated spindles of four parts, whose shares in the tip motion are known."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dsm import Bearing, Joint, Modes, Segment, Spindle, mode_shapes
from modal.arrays import Floats

PARTS = "tool", "holder", "spindle", "column"


def build(tool: Segment, holder: Segment, stiffness: tuple[float, ...]) -> Spindle:
    """Return a spindle whose bearings stand on springs, the column.

    stiffness: both joints (N/m, N m/rad each), both bearings and both housings (N/m).
    """
    end, nose = tool.length, tool.length + holder.length
    segments = [tool, holder, Segment(0.06, 0.09), Segment(0.15, 0.07), Segment(0.05, 0.06)]
    front, rear, front_housing, rear_housing = stiffness[4:]
    bearings = [
        Bearing(nose + 0.06, front, housing_stiffness=front_housing),
        Bearing(nose + 0.21, rear, housing_stiffness=rear_housing),
    ]
    return Spindle(segments, bearings, joints=[Joint(end, *stiffness[:2]), Joint(nose, *stiffness[2:4])])


SPINDLE = build(Segment(0.06, 0.02), Segment(0.1, 0.05), (5e8, 1e5, 2e9, 1e6, 2.5e8, 2e8, 4e8, 3e8))
"""Spindle of most tests."""


def draw(rng: np.random.Generator) -> Spindle:
    """Return a spindle with a random tool, holder, clamping, bearings and column."""
    tool = Segment(rng.uniform(0.03, 0.12), rng.uniform(0.01, 0.032))
    holder = Segment(rng.uniform(0.05, 0.16), rng.uniform(0.04, 0.07))
    low, high = [8.7, 4.7, 9.0, 5.7, 8.2, 8.0, 7.7, 7.7], [9.7, 6.0, 10.0, 6.7, 8.7, 8.6, 9.0, 9.0]
    return build(tool, holder, tuple(10 ** rng.uniform(low, high)))


class Point(NamedTuple):
    """Measured point."""

    part: str
    """Part."""
    position: float
    """Distance from the tip (m)."""
    motion: float
    """Motion over that of the shaft there."""


def place_points(spindle: Spindle) -> list[Point]:
    """Return the tip and two points each on holder, nose and column."""
    tool, holder = (segment.length for segment in spindle.segments[:2])
    nose = tool + holder
    points = [Point("tool", 0.0, 1.0), Point("holder", tool + 0.002, 1.0), Point("holder", tool + 0.7 * holder, 1.0)]
    points += [Point("spindle", nose + 0.002, 1.0), Point("spindle", nose + 0.04, 1.0)]
    return points + [Point("column", *pair) for pair in _list_housings(spindle)]


def _list_housings(spindle: Spindle) -> list[tuple[float, float]]:
    """Return the place of each bearing, and the motion of its housing over that of the shaft."""
    return [(one.position, one.support_stiffness / one.housing_stiffness) for one in spindle.bearings]


def soften(part: str, share: float) -> Spindle:
    """Return SPINDLE with the flexibility of a part, and of its clamping, multiplied by 1 + share."""
    factor = 1 / (1 + share)
    segments, bearings, joints = [*SPINDLE.segments], [*SPINDLE.bearings], [*SPINDLE.joints]
    own = {"tool": [0], "holder": [1], "spindle": [2, 3, 4], "column": []}[part]
    material = replace(SPINDLE.material, youngs_modulus=SPINDLE.youngs_modulus * factor)
    for i in own:
        segments[i] = replace(segments[i], material=material)
    if part in PARTS[:2]:
        i = PARTS.index(part)
        clamping = joints[i]
        stiffness, tilting = clamping.stiffness * factor, clamping.rotational_stiffness * factor
        joints[i] = replace(clamping, stiffness=stiffness, rotational_stiffness=tilting)
    elif part == "spindle":
        bearings = [replace(bearing, stiffness=bearing.stiffness * factor) for bearing in bearings]
    else:
        bearings = [replace(one, housing_stiffness=one.housing_stiffness * factor) for one in bearings]
    return replace(SPINDLE, segments=segments, bearings=bearings, joints=joints)


def true_shares(spindle: Spindle, count: int) -> tuple[Modes, Floats]:
    """Return modes and their exact shares, (count, 4): tangents of the parts, continued to the tip."""
    tool = spindle.segments[0].length
    (front, front_motion), (rear, rear_motion) = _list_housings(spindle)
    places = np.array([0.0, tool, tool + spindle.segments[1].length, front, rear])
    modes = mode_shapes(spindle, count)
    at_places = modes.at(places)
    u, slope = at_places.deflection, at_places.slope
    by_front, by_rear = u[:, 3] * front_motion, u[:, 4] * rear_motion
    column = by_front - (by_rear - by_front) / (rear - front) * front
    tips = [u[:, 0], *(u[:, i] - slope[:, i] * places[i] for i in (1, 2)), column, np.zeros(count)]
    return modes, -np.diff(np.array(tips), axis=0).T / u[:, :1]


def true_motion(modes: Modes, points: list[Point], mode: int) -> Floats:
    """Return the motion of points in a mode over that of the tip."""
    shaft = np.array([modes.deflection_at(point.position)[mode] for point in points])
    return np.asarray(shaft * [point.motion for point in points] / modes.deflection[mode, 0])
