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
"""Speeds given of each diagram, at most."""
FARTHEST = 0.5
"""Fall of the frequencies from which on no diagram is foretold: no such spindle still cuts; chosen."""
AHEAD = (6, 12)
"""Months after the newest test that are foretold."""

Floats = NDArray[np.float64]


class LobeCourse(NamedTuple):
    """Diagrams of one cut, oldest first; at least two."""

    cut: str
    """Name of the cut."""
    speed_rpm: Floats
    """Speeds common to all (rpm), shape (n,)."""
    times: Sequence[datetime]
    """Times of the tap tests, m of them."""
    depth: Floats
    """Limiting depths after each tap test (m), shape (m, n)."""
    ahead: Mapping[str, Floats]
    """Limiting depths that are foretold (m), shape (n,), by what each diagram is called."""
    heard: Sequence[HeardCut] = ()
    """Test cuts of the same cut, as they were heard."""

    @property
    def labels(self) -> list[str]:
        """Names of the diagrams."""
        return [*(f"{time:%Y-%m-%d}" for time in self.times), *self.ahead]

    @property
    def numbers(self) -> Numbers:
        """Speed, and depth in mm for each."""
        step = max(math.ceil(self.speed_rpm.size / SPEEDS), 1)
        depths = [*self.depth, *self.ahead.values()]
        return lobe_numbers(
            self.speed_rpm[::step], {name: depth[::step] for name, depth in zip(self.labels, depths, strict=True)}
        )

    @property
    def marks(self) -> Numbers | None:
        """The cuts, each with the number of the diagram (from 1) from which on it was known; None without any.

        A cut that is younger than the newest tap test belongs to that.
        """
        diagrams = [min(bisect_left(self.times, cut.at), len(self.times) - 1) + 1 for cut in self.heard]
        lines = [
            [at, cut.word, f"{cut.at:%Y-%m-%d}", cut.speed_rpm, 1e3 * cut.depth, cut.chatter_frequency_hz]
            for at, cut in zip(diagrams, self.heard, strict=True)
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
    diagrams = [(shown[i].time, row_lobes(shown[i], machine, [cut]).get(cut)) for i in picked]
    limits = [(time, lobes.depth) for time, lobes in diagrams if lobes is not None]
    if len(limits) < 2:
        return None
    trends = {side.direction: side.trend for side in series if side.tool == assembly.tool and side.trend is not None}
    times, depths = zip(*limits, strict=True)
    ahead = _foretold_depths(cut, assembly, trends, machine)
    heard = heard_of(cuts, cut, assembly.tool, machine.cuts(assembly.tool)[cut][0])
    return LobeCourse(cut, speed_grid(machine), times, np.stack(depths), ahead, heard)


def _foretold_depths(cut: str, assembly: Assembly, trends: Mapping[str, Trend], machine: Machine) -> dict[str, Floats]:
    depths: dict[str, Floats] = {}
    for months in AHEAD:
        shares = {name: _fall(trend, months) for name, trend in trends.items()}
        falls = {name: fall for name, fall in shares.items() if fall is not None}
        if not falls:
            break
        worst = max(falls.values())
        x, y = (_aged(assembly, name, falls.get(name, worst)) for name in ("x", "y"))
        lobes = tip_lobes(assembly.tool, x, y, machine, [cut], assembly.cross).get(cut)
        if lobes is not None:
            at = assembly.time + timedelta(days=months * MONTH)
            depths[f"{at:%Y-%m} (forecast)"] = lobes.depth
    return depths


def _fall(trend: Trend, months: int) -> float | None:
    """Share by which the line falls from the last point on; None where nothing is foretold for that long or so far."""
    forecast, last = trend.forecast, day(trend.points[-1].time)
    at = last + months * MONTH
    if forecast is None or trend.is_stale or not forecast.dates[0] <= at <= forecast.dates[-1]:
        return None
    change = float(np.interp(at, forecast.dates, forecast.line)) - float(forecast.fitted[-1])
    share = -math.expm1(min(change, 0.0) / 100)
    return share if share < FARTHEST else None


def _aged(assembly: Assembly, direction: str, fall: float) -> list[Mode]:
    stiffness_at, _ = softening(assembly)
    modes = (assembly.x if direction == "x" else assembly.y) or ()
    return [mode.scaled(1 - fall, stiffness_at(fall), "foretold") for mode in modes]
