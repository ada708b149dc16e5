"""Stability lobes of the report: the newest diagram, and diagrams over time."""

import math
from bisect import bisect_left
from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from lobes import StabilityLobes
from lobewatch.arrays import Floats
from lobewatch.cuts.learning.program_learning import LobesAtSpeed, compute_lobes_at_speed
from lobewatch.history import HistoryRow
from lobewatch.history.export_columns import compute_row_lobes
from lobewatch.logbook import Analysis
from lobewatch.machine import Machine
from lobewatch.machine.journal.cut_entry import CutEntry
from lobewatch.monitoring import SeriesStatus
from lobewatch.monitoring.trend import DAYS_PER_MONTH, Trend, days_since_epoch
from lobewatch.show.figures.lobe_figures import pick_evenly, plot_lobes, select_test_cuts
from lobewatch.show.programs.advice import ProgramAdvice
from lobewatch.show.report.section import NumberTable, tabulate_lobes
from lobewatch.tool import Assembly, compute_lobes, speed_grid
from lobewatch.tool.assembly import compute_tip_lobes
from lobewatch.verdicts import Setting, Verdict
from lobewatch.verdicts.monte_carlo import LimitBand, compute_limit_band
from lobewatch.verdicts.setting_robustness import model_softening
from modal import Mode


class LobeDiagram(NamedTuple):
    """Lobe diagram of one cut, then and now."""

    cut: str
    """Name of the cut: the reference cut, or else the first program of the tool."""
    now: StabilityLobes
    """Lobes of the newest tap tests."""
    depths: Mapping[str, Floats]
    """Limiting depths (m), shape (n,), at first, where known, and now, by the dates of the tap tests."""
    verdicts: Sequence[Verdict]
    """Verdicts on the programs with the same cut."""
    advice: Sequence[Setting]
    """Settings recommended for these programs."""
    band: LimitBand | None
    """Uncertainty band of the limit."""
    heard: Sequence[CutEntry]
    """Test cuts of the same cut."""
    learned: LobesAtSpeed | None
    """Lobes of the rotating spindle, corrected by test cuts."""

    def figure(self, *, is_small: bool = False) -> Figure:
        """Plot the diagram; is_small: smaller, to accompany text."""
        drawn = self.depths, self.verdicts, "", self.band, self.advice, self.heard, self.learned
        return plot_lobes(self.now.speed_rpm, *drawn, is_small=is_small)

    @property
    def edges(self) -> dict[str, Floats]:
        """Depths (m) of the bands and of the rotating spindle, by name."""
        edges = {} if self.band is None else {"lowest": self.band.low, "highest": self.band.high}
        if self.learned is not None:
            lobes, band = self.learned.lobes, self.learned.band
            edges |= {"at speed": lobes.depth, "at speed, lowest": band.low, "at speed, highest": band.high}
        return edges


def make_lobe_diagram(analysis: Analysis, assembly: Assembly, programs: Sequence[ProgramAdvice]) -> LobeDiagram | None:
    """Return the lobe diagram of a tool as tapped; None where it has no lobes."""
    machine = analysis.machine
    lobes = compute_lobes(assembly, machine)
    if not lobes:
        return None
    cut, now = next(iter(lobes.items()))
    first = analysis.first_assembly(assembly)
    depths = {} if first is None else {first.label: compute_lobes(first, machine)[cut].depth}
    cuts = machine.cuts(assembly.tool)
    same = [program for program in programs if cuts.get(program.verdict.program.name) == cuts[cut]]
    settings = (setting for program in same for setting in (program.advice.best, program.advice.deepest_here))
    verdicts, depths = [program.verdict for program in same], depths | {assembly.label: now.depth}
    band = compute_limit_band(now, cut, assembly, machine)
    heard = select_test_cuts(analysis.cuts, cut, assembly.tool, cuts[cut][0])
    learned = compute_lobes_at_speed(verdicts, machine)
    return LobeDiagram(cut, now, depths, verdicts, list(dict.fromkeys(filter(None, settings))), band, heard, learned)


MAX_LOBE_DIAGRAMS = 24
"""Largest number of tap tests shown."""
MAX_LOBE_SPEEDS = 600
"""Largest number of speeds of each diagram."""
MAX_FORECAST_DROP = 0.5
"""Frequency drop from which on no diagram is forecast: no such spindle still cuts; chosen."""
FORECAST_MONTHS = (6, 12)
"""Months after the newest test that are forecast."""


class LobeHistory(NamedTuple):
    """Lobe diagrams of one cut over time, oldest first; at least two."""

    cut: str
    """Name of the cut."""
    speed_rpm: Floats
    """Speeds common to all diagrams (rpm), shape (n,)."""
    times: Sequence[datetime]
    """Times of the tap tests, m of them."""
    depth: Floats
    """Limiting depths after each tap test (m), shape (m, n)."""
    ahead: Mapping[str, Floats]
    """Forecast limiting depths (m), shape (n,), by the label of each diagram."""
    heard: Sequence[CutEntry] = ()
    """Test cuts of the same cut."""

    @property
    def labels(self) -> list[str]:
        """Labels of the diagrams."""
        return [*(f"{time:%Y-%m-%d}" for time in self.times), *self.ahead]

    @property
    def numbers(self) -> NumberTable:
        """Depth (mm) over speed of each diagram."""
        step = max(math.ceil(self.speed_rpm.size / MAX_LOBE_SPEEDS), 1)
        named = zip(self.labels, [*self.depth, *self.ahead.values()], strict=True)
        return tabulate_lobes(self.speed_rpm[::step], {name: depth[::step] for name, depth in named})

    @property
    def marks(self) -> NumberTable | None:
        """Test cuts, each with the number of the diagram (from 1) that it first belongs to; None without any.

        A cut after the newest tap test belongs to the newest diagram.
        """
        diagrams = [min(bisect_left(self.times, cut.at), len(self.times) - 1) + 1 for cut in self.heard]
        lines = [
            [at, cut.word, f"{cut.at:%Y-%m-%d}", cut.speed_rpm, 1e3 * cut.depth, cut.chatter_frequency_hz]
            for at, cut in zip(diagrams, self.heard, strict=True)
        ]
        heads = ["from diagram", "heard", "date", "speed (rpm)", "depth (mm)", "chatter (Hz)"]
        return NumberTable(heads, lines) if lines else None


def compute_lobe_history(
    cut: str,
    rows: Sequence[HistoryRow],
    assembly: Assembly,
    series: Sequence[SeriesStatus],
    machine: Machine,
    cuts: Sequence[CutEntry] = (),
) -> LobeHistory | None:
    """Return the lobe diagrams of a series that show the cut; None where fewer than two do.

    assembly: the newest; series: of the same tool, for the forecast; cuts: all test cuts. The forecast lets all
    modes drop by the same share, with K from the model.
    """
    shown = pick_evenly([row for row in rows if row.x or row.y], MAX_LOBE_DIAGRAMS)
    diagrams = [(row.time, compute_row_lobes(row, machine, [cut]).get(cut)) for row in shown]
    limits = [(time, lobes.depth) for time, lobes in diagrams if lobes is not None]
    if len(limits) < 2:
        return None
    trends = {side.direction: side.trend for side in series if side.tool == assembly.tool and side.trend is not None}
    times, depths = zip(*limits, strict=True)
    ahead = _forecast_depths(cut, assembly, trends, machine)
    heard = select_test_cuts(cuts, cut, assembly.tool, machine.cuts(assembly.tool)[cut][0])
    return LobeHistory(cut, speed_grid(machine), times, np.stack(depths), ahead, heard)


def _forecast_depths(cut: str, assembly: Assembly, trends: Mapping[str, Trend], machine: Machine) -> dict[str, Floats]:
    depths: dict[str, Floats] = {}
    for months in FORECAST_MONTHS:
        shares = {name: _forecast_drop(trend, months) for name, trend in trends.items()}
        falls = {name: fall for name, fall in shares.items() if fall is not None}
        if not falls:
            break
        worst = max(falls.values())
        x, y = (_degraded_modes(assembly, name, falls.get(name, worst)) for name in ("x", "y"))
        lobes = compute_tip_lobes(assembly.tool, x, y, machine, [cut], assembly.cross).get(cut)
        if lobes is not None:
            at = assembly.time + timedelta(days=months * DAYS_PER_MONTH)
            depths[f"{at:%Y-%m} (forecast)"] = lobes.depth
    return depths


def _forecast_drop(trend: Trend, months: int) -> float | None:
    """Return the relative drop of the forecast line after some months; None where it is too long or too large."""
    forecast, last = trend.forecast, days_since_epoch(trend.points[-1].time)
    at = last + months * DAYS_PER_MONTH
    if forecast is None or trend.is_stale or not forecast.dates[0] <= at <= forecast.dates[-1]:
        return None
    change = float(np.interp(at, forecast.dates, forecast.mean_line)) - float(forecast.fitted[-1])
    share = -math.expm1(min(change, 0.0) / 100)
    return share if share < MAX_FORECAST_DROP else None


def _degraded_modes(assembly: Assembly, direction: str, fall: float) -> list[Mode]:
    stiffness = model_softening(assembly)[0](fall)
    modes = (assembly.x if direction == "x" else assembly.y) or ()
    return [mode.scaled(1 - fall, stiffness, "foretold") for mode in modes]
