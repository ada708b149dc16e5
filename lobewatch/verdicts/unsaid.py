"""What nobody says of a program or its spindle, and what it costs when the silence means something else."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from acquisition import Remark
from lobewatch.machine import Machine, ProgramTable
from lobewatch.verdicts.draws import ProgramDraws
from lobewatch.verdicts.judgement import Judgement
from lobewatch.verdicts.mean_force import MeanForce
from lobewatch.verdicts.ways import STEP

NARROW = 0.5
"""Radial depth over diameter below which a corner engages the tool far more than the straight before it ..."""
CORNER = 1.5
"""... as one with so many times the radius of the tool does, which stands for corners."""
HELIX_MATTERS = 0.2
"""Radial depth over diameter below which a helix moves the limit."""
CROSS_NOT_TAPPED = "cross-not-tapped"
"""Code of the remark that asks for a cross tap."""
CROSS_MATTERS = 1.04
"""Highest limit over the lowest, whatever the open axes of the modes are, from which on a cross tap is asked for."""


def unsaid(table: ProgramTable, machine: Machine, judgement: Judgement) -> Iterator[Remark]:
    """Remarks on what is assumed because the program does not say it."""
    if table.immersion < NARROW and table.corner_radius_mm is None and not isinstance(table.radial_depth_mm, tuple):
        yield _one_engagement(table, machine, judgement)
    if machine.helix_deg(table) is None and min(table.immersions) < HELIX_MATTERS:
        yield Remark(
            "helix-not-written",
            table.name,
            f"helix_deg is not written, and taken as 0: at a/D {min(table.immersions):.2g} edges with a helix may have "
            "0.7 to 1.7 times the limit",
            "write helix_deg, 0 for straight edges",
        )
    if judgement.across > CROSS_MATTERS:
        yield Remark(
            CROSS_NOT_TAPPED,
            table.name,
            "x and y show the same modes, taken as askew at their worst: the axes, which direct taps leave open, move "
            f"its limit by up to {100 * (judgement.across - 1):.0f} %",
            "tap --direction xy: hit in x, sensor in y",
        )


def _one_engagement(table: ProgramTable, machine: Machine, judgement: Judgement) -> Remark:
    radius = CORNER * table.tool_diameter_mm / 2
    inside, radial = table.in_corner(radius), table.radial_mm[1]
    limit = _limit_at(inside, table, machine, judgement.draws)
    share = f", {100 * limit / judgement.middle.limit:.0f} % of it" if limit < judgement.middle.limit < math.inf else ""
    return Remark(
        "one-engagement",
        table.name,
        f"judged at {radial:g} mm radial depth all the way: a corner of {radius:g} mm radius takes as much as "
        f"{inside * table.tool_diameter_mm:.2g} mm, and the limit is about {1e3 * limit:.2g} mm there{share}",
        f"write corner_radius_mm, or [least, greatest] as radial_depth_mm; [{radial:g}, {radial:g}] where the path is "
        "straight",
    )


def _limit_at(immersion: float, table: ProgramTable, machine: Machine, draws: ProgramDraws) -> float:
    """Limit (m) in the middle of the doubt by zero order at another engagement, whatever the feed."""
    cut, middle = replace(machine.build_cut(table), immersion=immersion), draws.rows[np.array([0])]
    fed = [replace(cut, feed_angle=i * STEP) for i in range(round(math.pi / STEP))]
    speed = np.array([table.speed_rpm])
    return min(float(MeanForce.of(middle.making(way)).limits(speed)[0][0, 0]) for way in fed)
