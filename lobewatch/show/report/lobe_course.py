"""Stability lobes of one cut over the history of a series, and where they go."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lobewatch.decay import SeriesStanding
from lobewatch.decay.trend import MONTH, Trend, day
from lobewatch.history import Row
from lobewatch.history.history_columns import row_lobes
from lobewatch.machine import Machine
from lobewatch.machine.journal.heard_cut import HeardCut
from lobewatch.show.figures.lobe_figures import heard_of
from lobewatch.show.report.figure_data import Numbers, lobe_numbers
from lobewatch.tool import Assembly, speed_grid
from lobewatch.tool.assembly import tip_lobes
from lobewatch.verdicts.aging import softening
from modal import Mode

MOST = 24
"""Tap tests shown, at most."""
SPEEDS = 600
"""Given of each diagram, at most."""
AHEAD = (6, 12)
"""Months after the newest test that are foretold."""

Floats = NDArray[np.float64]


class LobeCourse(NamedTuple):
    """Diagrams of one cut, oldest first; at least two."""

    cut: str
    """Its name."""
    speed_rpm: Floats
    """Common to all, shape (n,)."""
    times: Sequence[datetime]
    """Of the tap tests, m of them."""
    depth: Floats
    """Of the tap tests (m), shape (m, n)."""
    ahead: Mapping[str, Floats]
    """By what it is called: the same where it is foretold (m), shape (n,)."""
    heard: Sequence[HeardCut] = ()
    """Test cuts of the same cut, as they were heard."""

    @property
    def labels(self) -> list[str]:
        """What each is called."""
        return [*(f"{time:%Y-%m-%d}" for time in self.times), *self.ahead]

    @property
    def numbers(self) -> Numbers:
        """Speed, and depth in mm for each."""
        every = max(math.ceil(self.speed_rpm.size / SPEEDS), 1)
        depths = [*self.depth, *self.ahead.values()]
        return lobe_numbers(
            self.speed_rpm[::every], {name: one[::every] for name, one in zip(self.labels, depths, strict=True)}
        )

    @property
    def marks(self) -> Numbers | None:
        """The cuts, each with the number of the diagram (from 1) from which on it was known; None without any.

        A cut that is younger than the newest tap test belongs to that.
        """
        known = [min(bisect_left(self.times, cut.at), len(self.times) - 1) + 1 for cut in self.heard]
        lines = [
            [at, cut.word, f"{cut.at:%Y-%m-%d}", cut.speed_rpm, 1e3 * cut.depth, cut.chatter_frequency_hz]
            for at, cut in zip(known, self.heard, strict=True)
        ]
        heads = ["from diagram", "heard", "date", "speed (rpm)", "depth (mm)", "chatter (Hz)"]
        return Numbers(heads, lines) if lines else None


def lobe_course(
    cut: str,
    rows: Sequence[Row],
    assembly: Assembly,
    series: Sequence[SeriesStanding],
    machine: Machine,
    cuts: Sequence[HeardCut] = (),
) -> LobeCourse | None:
    """Over the rows of a series that show the cut; None where fewer than two do.

    assembly: that of now; series: of the same tool, where it goes; cuts: all that were heard. All modes fall alike,
    K follows the model.
    """
    shown = [row for row in rows if row.x or row.y]
    picked = np.unique(np.linspace(0, len(shown) - 1, min(len(shown), MOST)).round().astype(int)).tolist()
    found = [(shown[i].time, row_lobes(shown[i], machine, [cut]).get(cut)) for i in picked]
    known = [(time, lobes.depth) for time, lobes in found if lobes is not None]
    if len(known) < 2:
        return None
    trends = {one.direction: one.trend for one in series if one.tool == assembly.tool and one.trend is not None}
    times, depths = zip(*known, strict=True)
    ahead = _foretold(cut, assembly, trends, machine)
    heard = heard_of(cuts, cut, assembly.tool, machine.cuts(assembly.tool)[cut][0])
    return LobeCourse(cut, speed_grid(machine), times, np.stack(depths), ahead, heard)


def _foretold(cut: str, assembly: Assembly, trends: Mapping[str, Trend], machine: Machine) -> dict[str, Floats]:
    told: dict[str, Floats] = {}
    for months in AHEAD:
        falls = {name: _fall(trend, months) for name, trend in trends.items()}
        known = {name: fall for name, fall in falls.items() if fall is not None}
        if not known:
            break
        worst = max(known.values())
        x, y = (_aged(assembly, name, known.get(name, worst)) for name in ("x", "y"))
        lobes = tip_lobes(assembly.tool, x, y, machine, [cut]).get(cut)
        if lobes is not None:
            at = assembly.time + timedelta(days=months * MONTH)
            told[f"{at:%Y-%m} (forecast)"] = lobes.depth
    return told


def _fall(trend: Trend, months: int) -> float | None:
    """Share by which the line falls from the last point on; None where nothing is foretold for that long."""
    found, last = trend.forecast, day(trend.points[-1].time)
    at = last + months * MONTH
    if found is None or trend.is_stale or not found.dates[0] <= at <= found.dates[-1]:
        return None
    change = float(np.interp(at, found.dates, found.line)) - float(found.fitted[-1])
    return -math.expm1(min(change, 0.0) / 100)


def _aged(assembly: Assembly, direction: str, fall: float) -> list[Mode]:
    stiffness_at, _ = softening(assembly)
    modes = (assembly.x if direction == "x" else assembly.y) or ()
    return [mode.scaled(1 - fall, stiffness_at(fall), "foretold") for mode in modes]
