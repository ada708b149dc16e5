"""How far what is not known of spindle and cut moves the line of a diagram."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lobes import Cut, MillingRows, Program, StabilityLobes, lowest_of, zero_order
from lobewatch.analysis.assembly import Assembly
from lobewatch.analysis.charts import cut_table
from lobewatch.analysis.programs.doubt import doubt_of
from lobewatch.analysis.programs.drawn import middle_row
from lobewatch.analysis.programs.verdict import QUANTILES
from lobewatch.machine import Machine
from modal import Mode

DRAWS = 64
"""From the doubt."""
SPEEDS, FINE = 81, 1500
"""Of the diagrams of the draws, and of the one in the middle."""
BEYOND = 1.15
"""How far beyond the speeds of the line the one in the middle goes."""
DEEP = 1e3
"""Stands for no limit (m)."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LimitBand:
    """Between 1 and 99 % of the limits over the doubt, at the speeds of a diagram."""

    speed_rpm: Floats
    """Spindle speeds (rpm), shape (n,)."""
    low: Floats
    """1 % quantile of the limit, the line itself where that is lower (m), shape (n,)."""
    high: Floats
    """99 % quantile, or the line (m), shape (n,); inf where there is no limit."""


def limit_band(line: StabilityLobes, cut: str, assembly: Assembly, machine: Machine) -> LimitBand:
    """The band around the line of a cut (its name), by draws from the doubt (`doubt_of`).

    Each draw is worked out by zero order. Of a line by another method it is the same line at the speed that belongs to
    the frequency of the draw, times what zero order says of the rest: that is exact for a line by zero order, and for
    any method as to spindle speed, cutting coefficient, and changes that all modes share.
    """
    cuts = machine.cuts(assembly.tool)[cut]
    rows = middle_row(Program(cuts[0], 1.0, 1.0), assembly)
    drawn = doubt_of(assembly, cut_table(machine, cut), machine).draw(rows, DRAWS)
    softest = int(np.argmin(rows.stiffness[0] * rows.damping_ratio[0]))
    moved = drawn.speed_rpm / (drawn.frequency[:, softest] / rows.frequency[0, softest])
    low, high = float(np.min(line.speed_rpm)), float(np.max(line.speed_rpm))
    speeds, wide = np.geomspace(low, high, SPEEDS), np.geomspace(low / BEYOND, high * BEYOND, FINE)
    middle = _depth(rows, 0, cuts, wide)
    limits = np.empty((DRAWS, line.speed_rpm.size))
    order = np.argsort(line.speed_rpm)
    known = line.speed_rpm[order], np.minimum(line.depth[order], DEEP)
    for i, ratio in enumerate(moved.tolist()):
        rest = _depth(drawn, i, cuts, speeds) / np.interp(np.clip(ratio * speeds, low, high), wide, middle)
        at = np.clip(ratio * line.speed_rpm, low, high)
        limits[i] = np.interp(at, *known) * np.interp(line.speed_rpm, speeds, rest)
    lowest, highest = np.quantile(limits, QUANTILES, axis=0)
    return LimitBand(
        line.speed_rpm,
        np.minimum(lowest, line.depth),
        np.maximum(np.where(highest < DEEP / 2, highest, np.inf), line.depth),
    )


def _depth(rows: MillingRows, i: int, cuts: Sequence[Cut], speed_rpm: Floats) -> Floats:
    """Limit of one of the rows by zero order at speeds (rpm), DEEP where there is none."""
    modes: dict[int, list[Mode]] = {0: [], 1: []}
    for k, direction in enumerate(rows.axes[rows.direction].tolist()):
        frequency = float(rows.frequency[i, k]) / (2 * np.pi)
        damping, stiffness = float(rows.damping_ratio[i, k]), float(rows.stiffness[i, k])
        phase = math.degrees(rows.phase[i, k]) if damping < 1 else 0.0
        modes[direction].append(Mode(frequency, damping, stiffness, phase_deg=phase))
    turned = [replace(cut, tangential=float(rows.tangential[i]), radial=float(rows.radial[i])) for cut in cuts]
    speeds = float(rows.speed_rpm[i]) * speed_rpm
    found = lowest_of([zero_order(modes[0], modes[1], cut, speeds) for cut in turned])
    return np.minimum(found.depth, DEEP)
