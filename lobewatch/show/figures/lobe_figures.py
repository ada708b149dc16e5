"""Plot stability lobes: diagram, waterfall over time, map over radial depth."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, DateFormatter, date2num
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator

from acquisition import DataError, Remark
from acquisition.errors import join_sentences
from lobes import Cut, RadialLobes, StabilityLobes, radial_lobes
from lobewatch.arrays import Floats
from lobewatch.cuts.learning.program_learning import LobesAtSpeed, compute_lobes_at_speed
from lobewatch.history import HistoryRow
from lobewatch.history.history import compute_row_lobes
from lobewatch.logbook import LobeComparison, Logbook
from lobewatch.machine import Machine
from lobewatch.machine.journal.entries import CutEntry, geometry_key
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.show.figures.drawing import LabelPlacer, Paint, lay_out, new_axes, save_figure
from lobewatch.show.terminal.output import count_noun
from lobewatch.tool import LobeChart, LobeMethod, compute_lobe_chart, speed_grid
from lobewatch.verdicts import Setting, Stability, Verdict
from lobewatch.verdicts.monte_carlo import LimitBand, compute_limit_band

DEPTH_COLORMAP = "cividis"
"""Colormap of depth: dark is shallow, bright is deep, in grey too."""
BAND_LABEL = "uncertainty band (98 %): spindle and cutting data"
VERDICT_MARKS = {
    Stability.STABLE: (Paint.GOOD, "o"),
    Stability.DOUBTFUL: ("#B58900", "^"),
    Stability.NOT_STABLE: (Paint.ALARM, "X"),
    Stability.UNKNOWN: (Paint.UNKNOWN, "D"),
}
"""Paint and mark of a program for each verdict."""
POCKET_GREEN = "#00664A"
LEARNED_PURPLE = "#8A3D78"
LARGE_FIGURE_SIZE, SMALL_FIGURE_SIZE = (8.0, 4.6), (6.4, 4.4)
"""Size of a separate diagram, and of the one in the report (inches)."""
MAP_LEVELS = 12
"""Number of levels of a map."""
DEPTH_SCALE_LABEL = "limiting depth ap ({}), brightest: top value or more"
MAX_DAYS_WITH_TIME = 10.0
"""Longest range that is labelled with times, not only with dates (days)."""
TEST_CUT_MARKS = {False: ("test cut, stable", Paint.GOOD, "o"), True: ("test cut, chatter", Paint.ALARM, "x")}
"""Label, paint and mark of stable cuts and of cuts with chatter, wide and hollow."""
TEST_CUT_MARK_SIZE, PROGRAM_MARK_SIZE = 11.0, 9.0
"""Size of the marks of test cuts and of programs (points)."""


class LobeDiagram(NamedTuple):
    """Lobe diagram of one cut, then and now."""

    cut: str
    """Name of the cut: the reference cut, or else the first program of the tool."""
    now: StabilityLobes
    """Lobes of the newest tap tests."""
    depths: Mapping[str, Floats]
    """Limiting depths (m), shape (n,), by label, the newest last."""
    verdicts: Sequence[Verdict] = ()
    """Verdicts on the programs with the same cut."""
    pockets: Sequence[Setting] = ()
    """Recommended settings."""
    band: LimitBand | None = None
    """Uncertainty band of the limit."""
    heard: Sequence[CutEntry] = ()
    """Test cuts of the same cut."""
    learned: LobesAtSpeed | None = None
    """Lobes of the rotating spindle, corrected by test cuts."""

    @property
    def edges(self) -> dict[str, Floats]:
        """Depths (m) of the bands and of the rotating spindle, by name."""
        edges = {} if self.band is None else {"lowest": self.band.low, "highest": self.band.high}
        if self.learned is not None:
            lobes, band = self.learned.lobes, self.learned.band
            edges |= {"at speed": lobes.depth, "at speed, lowest": band.low, "at speed, highest": band.high}
        return edges


def plot_lobes(diagram: LobeDiagram, title: str = "", *, is_small: bool = False) -> Figure:
    """Plot a stability lobe diagram; is_small: for the report, with only the names of programs."""
    figure, (axes,) = new_axes(1, SMALL_FIGURE_SIZE if is_small else LARGE_FIGURE_SIZE)
    speed_rpm, band = diagram.now.speed_rpm, diagram.band
    *earlier, (label, now) = diagram.depths.items()
    scale = 1e3 * LENGTH.scale
    finite = now[np.isfinite(now)] * scale
    wanted = [LENGTH.scale * verdict.program.depth_mm for verdict in diagram.verdicts]
    wanted += [LENGTH.scale * pocket.depth_mm for pocket in diagram.pockets]
    wanted += [scale * cut.depth for cut in diagram.heard]
    top = max([5 * float(finite.min()) if finite.size else LENGTH.scale, *(1.3 * depth for depth in wanted)])
    edges = (now, now) if band is None else (band.low, band.high)
    low, high = (np.minimum(edge * scale, 2 * top) for edge in edges)
    axes.fill_between(speed_rpm, high, 2 * top, color=Paint.NEWEST, alpha=0.10, lw=0)
    if band is not None:
        axes.fill_between(speed_rpm, low, high, color=Paint.NEWEST, alpha=0.35, lw=0, label=BAND_LABEL)
    axes.plot(speed_rpm, now * scale, color=Paint.NEWEST, lw=1.6, label=label)
    for first, depth in earlier:
        axes.plot(speed_rpm, depth * scale, color=Paint.FIRST, ls="--", lw=1.2, label=f"{first}, first tap tests")
    if diagram.learned is not None:
        _draw_learned(axes, diagram.learned, 2 * top)
    axes.set(ylim=(0, top), xlim=(speed_rpm[0], speed_rpm[-1]), title=title)
    axes.set(xlabel="spindle speed (rpm)", ylabel=f"limiting depth ap ({LENGTH.unit})")
    _draw_marks(axes, diagram)
    figure.legend(loc="outside lower center", ncols=1 if is_small else 2, frameon=False, fontsize=9)
    lay_out(figure)
    _label_marks(axes, diagram, is_small=is_small)
    return figure


def plot_waterfall(speed_rpm: Floats, times: Sequence[datetime], depth: Floats, title: str = "") -> Figure:
    """Plot limiting depth over speed and time: depth (m), shape (n, m), at n times, the oldest at the bottom."""
    figure, (axes,) = new_axes(1, (8.0, 4.2))
    top = _map_limit(depth)
    rows, columns = _cell_edges(date2num(times), 30.0), _cell_edges(speed_rpm, 1.0)
    style: dict[str, Any] = {"cmap": DEPTH_COLORMAP, "vmin": 0, "vmax": top, "rasterized": True}
    mesh = axes.pcolormesh(columns, rows, np.minimum(depth * (1e3 * LENGTH.scale), top), **style)
    figure.colorbar(mesh, ax=axes, label=DEPTH_SCALE_LABEL.format(LENGTH.unit))
    axes.yaxis.set_major_locator(AutoDateLocator())
    axes.yaxis.set_major_formatter(DateFormatter("%Y-%m-%d" if np.ptp(rows) > MAX_DAYS_WITH_TIME else "%Y-%m-%d %H:%M"))
    axes.set(title=title, xlabel="spindle speed (rpm)", ylabel="date", xlim=(speed_rpm[0], speed_rpm[-1]))
    axes.grid(visible=False)
    return figure


def plot_radial_map(lobes: RadialLobes, diameter: float, present: float, title: str = "") -> Figure:
    """Plot limiting depth over speed and radial depth of cut for a cutter of this diameter (m) as a contour map.

    present: radial immersion of the cut itself, drawn as a dashed line. The contours are those of 1/depth, which is
    smooth where a pocket has no limit.
    """
    figure, (axes,) = new_axes(1, (8.0, 4.2))
    depths = np.asarray(MaxNLocator(MAP_LEVELS).tick_values(0, _map_limit(lobes.depth)))[1:]
    scale = 1e3 * LENGTH.scale
    radial, softness = lobes.immersion * diameter * scale, 1 / (scale * lobes.depth)
    levels = 1 / depths[::-1]
    colours = colormaps[DEPTH_COLORMAP](np.linspace(1, 0, levels.size + 1))
    mesh = axes.contourf(lobes.speed_rpm, radial, softness, levels=levels, colors=colours, extend="both")
    axes.contour(lobes.speed_rpm, radial, softness, levels=levels, colors="black", linewidths=0.3)
    axes.axhline(present * diameter * scale, color=Paint.ALARM, ls="--", lw=2, clip_on=False)
    bar = figure.colorbar(mesh, ax=axes, spacing="uniform", label=DEPTH_SCALE_LABEL.format(LENGTH.unit))
    bar.ax.invert_yaxis()
    bar.set_ticks(levels.tolist(), labels=[f"{depth:g}" for depth in depths[::-1]])
    if lobes.remarks:
        figure.supxlabel(fill(join_sentences(*map(str, lobes.remarks)), 120), fontsize=8)
    axes.set(
        title=title, xlabel="spindle speed (rpm)", ylabel=f"radial depth ae ({LENGTH.unit}), dashed: ae of the cut"
    )
    axes.grid(visible=False)
    return figure


def _cell_edges(middles: Floats, alone: float) -> Floats:
    """Return the edges of cells around their centers; a single cell has the width `alone`."""
    halves = np.diff(middles) / 2 if middles.size > 1 else np.array([alone / 2])
    inner = middles[:-1] + halves[: middles.size - 1]
    return np.concatenate((middles[:1] - halves[0], inner, middles[-1:] + halves[-1]))


def _map_limit(depth: Floats) -> float:
    """Return the largest depth (shown unit) of a map of depths (m)."""
    finite = depth[np.isfinite(depth)] * (1e3 * LENGTH.scale)
    return min(6 * float(finite.min()), float(finite.max())) if finite.size else LENGTH.scale


def _draw_learned(axes: Axes, learnt: LobesAtSpeed, deepest: float) -> None:
    """Draw the line and the band of the rotating spindle, clipped at the deepest depth (shown unit)."""
    scale = 1e3 * LENGTH.scale
    label = f"at speed, learned from {count_noun(learnt.n_cuts, 'test cut')}"
    left = "uncertainty band (98 %) after test cuts"
    low, high = (np.minimum(edge * scale, deepest) for edge in (learnt.band.low, learnt.band.high))
    axes.fill_between(learnt.band.speed_rpm, low, high, color=LEARNED_PURPLE, alpha=0.25, lw=0, label=left)
    axes.plot(learnt.lobes.speed_rpm, learnt.lobes.depth * scale, color=LEARNED_PURPLE, ls="-.", lw=1.6, label=label)


def _draw_marks(axes: Axes, diagram: LobeDiagram) -> None:
    """Draw test cuts, pockets and programs."""
    for chatters, (name, colour, mark) in TEST_CUT_MARKS.items():
        marked = [cut for cut in diagram.heard if cut.has_chatter == chatters]
        if marked:
            places = [cut.speed_rpm for cut in marked], [1e3 * LENGTH.scale * cut.depth for cut in marked]
            axes.plot(*places, mark, color=colour, mfc="none", ms=TEST_CUT_MARK_SIZE, mew=2.2, zorder=4, label=name)
    style: dict[str, Any] = {"fc": "white", "ec": POCKET_GREEN, "lw": 1.2, "hatch": "////"}
    for i, pocket in enumerate(diagram.pockets):
        (low, high), depth = pocket.window_rpm, LENGTH.scale * pocket.depth_mm
        axes.add_patch(
            Rectangle((low, 0), high - low, depth, label="" if i else "recommended speeds and depths", **style)
        )
    for program in diagram.verdicts:
        paint, symbol = VERDICT_MARKS[program.stability]
        place = program.program.speed_rpm, LENGTH.scale * program.program.depth_mm
        axes.plot(*place, symbol, color=paint, ms=PROGRAM_MARK_SIZE, mec="white")


def _label_marks(axes: Axes, diagram: LobeDiagram, *, is_small: bool) -> None:
    """Label test cuts with their chatter frequency, pockets and programs; is_small: only names of programs."""
    labels, scale = LabelPlacer(axes, may_lack=is_small), LENGTH.scale
    for cut in diagram.heard:
        labels.reserve_mark((cut.speed_rpm, 1e3 * scale * cut.depth), TEST_CUT_MARK_SIZE)
    for cut in diagram.heard:
        if cut.chatter_frequency_hz is not None:
            labels.add(f"{cut.chatter_frequency_hz:.0f} Hz", (cut.speed_rpm, 1e3 * scale * cut.depth), Paint.ALARM)
    for pocket in diagram.pockets:
        labels.reserve_area((pocket.window_rpm[0], 0.0), (pocket.window_rpm[1], scale * pocket.depth_mm))
    places = [(program.program.speed_rpm, scale * program.program.depth_mm) for program in diagram.verdicts]
    for place in places:
        labels.reserve_mark(place, PROGRAM_MARK_SIZE)
    for pocket in () if is_small else diagram.pockets:
        text = f"{pocket.speed_rpm:.0f} rpm\n{LENGTH.text(pocket.depth_mm, '.2f')}"
        labels.add(text, (pocket.speed_rpm, scale * pocket.depth_mm), POCKET_GREEN, ("above", "right", "left"))
    for program, place in zip(diagram.verdicts, places, strict=True):
        name = program.program.name
        labels.add(name if is_small else f"{name}\n{program.stability}", place)


def select_test_cuts(cuts: Sequence[CutEntry], name: str, tool: str, cut: Cut) -> list[CutEntry]:
    """Select usable test cuts of this tool, cutter and immersion, with the same name or the same coefficients."""
    usable = (heard for heard in cuts if heard.is_usable and heard.tool == tool)
    alike = [heard for heard in usable if geometry_key(heard.cut) == geometry_key(cut)]
    force = cut.tangential, cut.radial
    return [heard for heard in alike if heard.program == name or (heard.cut.tangential, heard.cut.radial) == force]


MAX_WATERFALL_ROWS = 200
"""Largest number of tap tests in a waterfall."""


def save_lobe_figures(
    logbook: Logbook,
    comparison: LobeComparison,
    method: LobeMethod,
    figure: Path | None,
    radial: Path | None,
    waterfall: Path | None,
) -> list[Remark]:
    """Write the figures that have a file, all or none, and return remarks on them."""
    pictures, remarks = list[tuple[Figure, Path]](), list[Remark]()
    if figure is not None:
        pictures.append((plot_comparison(logbook.machine, comparison, logbook.cuts), figure))
    if radial is not None:
        picture, about = plot_radial_lobes(logbook.machine, comparison.now, method)
        pictures.append((picture, radial))
        remarks += [replace(remark, about="--radial") for remark in about]
    if waterfall is not None:
        pictures.append((plot_series_waterfall(logbook, comparison.now), waterfall))
    for picture, path in pictures:
        save_figure(picture, path)
    return remarks


def plot_comparison(machine: Machine, comparison: LobeComparison, cuts: Sequence[CutEntry]) -> Figure:
    """Plot the newest diagram with its uncertainty band and the first one, with pockets, programs and test cuts."""
    now, verdicts = comparison.now, comparison.verdicts
    depths = {diagram.assembly.label: diagram.lobes.depth for diagram in (comparison.then, now) if diagram is not None}
    band = compute_limit_band(now.lobes, now.name, now.assembly, machine)
    heard = select_test_cuts(cuts, now.name, now.assembly.tool, now.cuts[0])
    learned = compute_lobes_at_speed(verdicts, machine)
    diagram = LobeDiagram(now.name, now.lobes, depths, verdicts, comparison.pockets, band, heard, learned)
    return plot_lobes(diagram, f"{_lobes_title(machine, now)}, from the {now.source}")


def _lobes_title(machine: Machine, now: LobeChart) -> str:
    if now.assembly.is_stated:
        return f"{now.assembly.label}\n{now.lobes.method}"
    predicted = f", {now.assembly.label}" if now.assembly.predicted else ""
    return f"{machine.machine.name}: {now.name}\n{now.lobes.method}{predicted}"


def plot_radial_lobes(machine: Machine, now: LobeChart, method: LobeMethod) -> tuple[Figure, tuple[Remark, ...]]:
    """Plot the limits over speed and radial depth of cut, and return the remarks on the method."""
    speeds = now.lobes.speed_rpm if method is not LobeMethod.SEMI_DISCRETISATION else now.lobes.speed_rpm[::4]

    def limits(cut: Cut) -> StabilityLobes:
        cuts = [replace(simultaneous, immersion=cut.immersion) for simultaneous in now.cuts]
        return compute_lobe_chart(method, now.x, now.y, cuts, speeds)

    radial = radial_lobes(limits, now.cuts[0], np.linspace(0.05, 1.0, 39))
    diameter = now.table.tool_diameter_mm / 1e3
    return plot_radial_map(radial, diameter, now.cuts[0].immersion, _lobes_title(machine, now)), radial.remarks


def plot_series_waterfall(logbook: Logbook, now: LobeChart) -> Figure:
    """Plot the limits over all tap tests of the newest series; raise DataError without measured lobes."""
    cut, tool = now.name, now.assembly.tool
    newest = None if now.assembly.predicted else logbook.measurement(now.assembly.tap_id)
    series = [] if newest is None else logbook.history.series(tool, newest.direction)
    shown = [row for row in pick_evenly(series, MAX_WATERFALL_ROWS) if row.x]
    diagrams = [(row.time, compute_row_lobes(row, logbook.machine, [cut]).get(cut)) for row in shown]
    limits = [(time, lobes.depth) for time, lobes in diagrams if lobes is not None]
    if not limits:
        raise DataError(f"--waterfall: no measured lobes of {cut!r} with tool {tool!r}")
    times, depths = zip(*limits, strict=True)
    title = f"{logbook.machine.machine.name}: {cut}\nzero-order approximation"
    return plot_waterfall(speed_grid(logbook.machine), times, np.stack(depths), title)


def pick_evenly(rows: Sequence[HistoryRow], most: int) -> list[HistoryRow]:
    """Return the first row, the newest, and others evenly spaced between them, no more than `most`."""
    return [rows[i] for i in np.unique(np.linspace(0, len(rows) - 1, min(len(rows), most)).round().astype(int))]
