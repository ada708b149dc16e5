"""How far what is not known of spindle and cut moves the line of a diagram."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lobes import Cut, MillingRows, Program, StabilityLobes
from lobewatch.machine import Machine
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.charts import cut_table
from lobewatch.verdicts.doubt import doubt_of
from lobewatch.verdicts.draws import middle_row
from lobewatch.verdicts.judgement import QUANTILES
from lobewatch.verdicts.mean_force import MeanForce
from lobewatch.verdicts.spindle_at_speed import AT_REST, SpindleAtSpeed

DRAWS = 64
"""Number of draws from the doubt."""
SPEEDS = 81
"""Number of speeds of their diagrams."""
DEEP = 1e3
"""Depth that stands for no limit (m)."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LimitBand:
    """Band between 1 and 99 % of the limits over the doubt, at the speeds of a diagram."""

    speed_rpm: Floats
    """Spindle speeds (rpm), shape (n,)."""
    low: Floats
    """1 % quantile of the limit, the line itself where that is lower (m), shape (n,)."""
    high: Floats
    """99 % quantile, or the line (m), shape (n,); inf where there is no limit."""


def limit_band(
    line: StabilityLobes, cut: str, assembly: Assembly, machine: Machine, at_speed: SpindleAtSpeed = AT_REST
) -> LimitBand:
    """The band around the line of a cut (its name), by draws from the doubt.

    Each draw is worked out by zero order. Of a line by another method it is the same line at the speed that belongs to
    the frequency of the draw, times what zero order says of the rest: that holds to a per cent for a line by zero
    order, and for any method as to spindle speed, cutting coefficient, and changes that all modes share.
    """
    cuts = machine.cuts(assembly.tool)[cut]
    rows = middle_row(Program(cuts[0], 1.0, 1.0), at_speed.moved(assembly))
    doubt = at_speed.doubt or doubt_of(assembly, cut_table(machine, cut), machine)
    draws = doubt.draw(rows, DRAWS)
    softest = int(np.argmin(rows.stiffness[0] * rows.damping_ratio[0]))
    moved = (draws.speed_rpm / (draws.frequency[:, softest] / rows.frequency[0, softest]))[:, np.newaxis]
    low, high = float(np.min(line.speed_rpm)), float(np.max(line.speed_rpm))
    speeds, middle = np.geomspace(low, high, SPEEDS), rows[np.zeros(DRAWS, np.intp)]
    depths = _depths(draws, cuts, draws.speed_rpm[:, np.newaxis] * speeds)
    ratios = depths / _depths(middle, cuts, np.clip(moved * speeds, low, high))
    order = np.argsort(line.speed_rpm)
    rising = line.speed_rpm[order], np.minimum(line.depth[order], DEEP)
    limits = np.interp(np.clip(moved * line.speed_rpm, low, high), *rising)
    limits *= [np.interp(line.speed_rpm, speeds, ratio) for ratio in ratios]
    lowest, highest = np.quantile(limits, QUANTILES, axis=0)
    return LimitBand(
        line.speed_rpm,
        np.minimum(lowest, line.depth),
        np.maximum(np.where(highest < DEEP / 2, highest, np.inf), line.depth),
    )


def _depths(rows: MillingRows, cuts: Sequence[Cut], speed_rpm: Floats) -> Floats:
    """Limit of each row in the worst of some cuts at speeds (rpm) of its own (r, s), DEEP where there is none."""
    depths = [MeanForce.of(rows.making(cut)).limits(speed_rpm)[0] for cut in cuts]
    return np.asarray(np.minimum(np.min(depths, axis=0), DEEP))
