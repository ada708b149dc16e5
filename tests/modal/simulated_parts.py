"""Simulated spindle of four parts, whose shares in the tip motion are known."""

from dataclasses import replace

import numpy as np

from dsm import Bearing, Joint, Modes, Segment, Spindle, mode_shapes
from modal.arrays import Floats

PARTS = "tool", "holder", "spindle", "column"
TOOL, NOSE = 0.06, 0.16
"""Places where tool and holder end (m)."""
SPINDLE = Spindle(
    [Segment(0.06, 0.02), Segment(0.10, 0.05), Segment(0.06, 0.09), Segment(0.15, 0.07), Segment(0.05, 0.06)],
    [Bearing(0.22, 2.5e8, housing_stiffness=4e8), Bearing(0.37, 2e8, housing_stiffness=3e8)],
    joints=[Joint(TOOL, 5e8, 1e5), Joint(NOSE, 2e9, 1e6)],
)
"""Spindle whose bearings stand on springs, the column."""
HOUSING_MOTION = [bearing.support_stiffness / bearing.housing_stiffness for bearing in SPINDLE.bearings]
"""Motion of the column at each bearing over that of the shaft."""
POINTS = (
    ("tool", 0.0, 1.0),
    ("holder", TOOL + 0.002, 1.0),
    ("holder", 0.13, 1.0),
    ("spindle", NOSE + 0.002, 1.0),
    ("spindle", 0.2, 1.0),
    ("column", 0.22, HOUSING_MOTION[0]),
    ("column", 0.37, HOUSING_MOTION[1]),
)
"""Part, place (m), and motion over that of the shaft, of measured points."""


def soften(part: str, share: float) -> Spindle:
    """Return the spindle with the flexibility of a part, and of its clamping, multiplied by 1 + share."""
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


def true_shares(count: int) -> tuple[Modes, Floats]:
    """Return modes and their exact shares, (count, 4): tangents of the parts, continued to the tip."""
    places = np.array([0.0, TOOL, NOSE, *(bearing.position for bearing in SPINDLE.bearings)])
    modes = mode_shapes(SPINDLE, count, places)
    u, slope = modes.deflection, modes.slope
    front, rear = u[:, 3] * HOUSING_MOTION[0], u[:, 4] * HOUSING_MOTION[1]
    column = front - (rear - front) / (places[4] - places[3]) * places[3]
    tips = [u[:, 0], *(u[:, i] - slope[:, i] * places[i] for i in (1, 2)), column, np.zeros(count)]
    return modes, -np.diff(np.array(tips), axis=0).T / u[:, :1]
