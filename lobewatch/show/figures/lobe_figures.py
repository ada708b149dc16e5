"""Pictures of stability lobes, in the colours of figures.py."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from textwrap import fill

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, DateFormatter, date2num
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from lobes import Cut, RadialLobes
from lobewatch.cuts.learning.at_speed import LobesAtSpeed
from lobewatch.machine.journal.heard_cut import HeardCut, geometry
from lobewatch.show.figures.labels import PHONE, PictureLabels
from lobewatch.show.figures.style import ALARM, GOOD, NOW, THEN, UNKNOWN, new_axes
from lobewatch.verdicts import Setting, Verdict, Word
from lobewatch.verdicts.limit_band import LimitBand

Floats = NDArray[np.float64]

MAP = "cividis"
"""Colours of depth: dark is shallow, bright is deep, in grey too."""
BAND = "what is not known of spindle and cut moves the limit within this band"
WINDOW = "safe speeds and depths"
DOUBT = "#B58900"
MARKS = {
    Word.STABLE: (GOOD, "o"),
    Word.DOUBTFUL: (DOUBT, "^"),
    Word.NOT_STABLE: (ALARM, "X"),
    Word.UNKNOWN: (UNKNOWN, "D"),
}
"""Colour and mark of a program by the verdict on it."""
SAFE = "#00664A"
LEARNT = "#8A3D78"
LARGE, SMALL = (8.0, 4.6), (5.6, 2.3)
"""Size of a diagram that stands alone, and of one beside words (inches)."""
LEVELS = 12
"""Steps of colour in a map."""
BAR = "limiting depth (mm); brightest: this or more"
SHORT = 10.0
"""Days below which dates are told with their time."""
HEARD_MARKS = {False: ("heard stable", GOOD, "o"), True: ("heard to chatter", ALARM, "x")}
"""Name, colour and mark of cuts by whether they chatter; wide and hollow, so that a program's own shows through."""
HEARD_SIZE, MARK_SIZE = 11.0, 9.0
"""Size of these marks, and of those of programs (points)."""
FEW = 6
"""Number of speeds, at most, that are named along a small picture."""


def lobes_figure(
    speed_rpm: Floats,
    depths: Mapping[str, Floats],
    programs: Sequence[Verdict] = (),
    title: str = "",
    band: LimitBand | None = None,
    pockets: Sequence[Setting] = (),
    heard: Sequence[HeardCut] = (),
    learnt: LobesAtSpeed | None = None,
    *,
    is_small: bool = False,
) -> Figure:
    """Stability lobe diagram: the last of `depths` (m, by label) is now, those before it are first tap tests.

    band: how far the doubt moves the line of now; pockets: settings that are recommended; heard: test cuts of it;
    learnt: what these have taught; is_small: beside words that say the rest, with the names of programs alone.
    """
    figure, (axes,) = new_axes(1, SMALL if is_small else LARGE)
    *earlier, now = depths.items()
    finite = now[1][np.isfinite(now[1])] * 1e3
    wanted = [verdict.program.depth_mm for verdict in programs] + [pocket.depth_mm for pocket in pockets]
    wanted += [1e3 * cut.depth for cut in heard]
    top = max([5 * float(finite.min()) if finite.size else 1.0, *(1.3 * depth for depth in wanted)])
    low, high = (now[1], now[1]) if band is None else (band.low, band.high)
    low, high = (np.minimum(edge * 1e3, 2 * top) for edge in (low, high))
    axes.fill_between(speed_rpm, high, 2 * top, color=NOW, alpha=0.10, lw=0)
    if band is not None:
        axes.fill_between(speed_rpm, low, high, color=NOW, alpha=0.35, lw=0, label=BAND)
    axes.plot(speed_rpm, now[1] * 1e3, color=NOW, lw=1.6, label=now[0])
    for label, depth in earlier:
        axes.plot(speed_rpm, depth * 1e3, color=THEN, ls="--", lw=1.2, label=f"{label}, first tap tests")
    if learnt is not None:
        _draw_learnt(axes, learnt, 2 * top)
    axes.set(ylim=(0, top), xlim=(speed_rpm[0], speed_rpm[-1]), title=title)
    axes.set(xlabel="spindle speed (rpm)", ylabel="" if is_small else "limiting depth (mm)")
    if is_small:
        axes.xaxis.set_major_locator(MaxNLocator(FEW))
        figure.draw_without_rendering()  # its room is known from now on
    _draw_marks(axes, programs, pockets, heard, is_small)
    if not is_small:
        figure.legend(loc="outside lower center", ncols=2, frameon=False, fontsize=9)
    return figure


def waterfall_figure(speed_rpm: Floats, times: Sequence[datetime], depth: Floats, title: str = "") -> Figure:
    """Limiting depth over speed and time: depth (n, m) in m at n times, the oldest below."""
    figure, (axes,) = new_axes(1, (8.0, 4.2))
    top = _top(depth)
    rows, columns = _edges(date2num(times), 30.0), _edges(speed_rpm, 1.0)
    mesh = axes.pcolormesh(columns, rows, np.minimum(depth * 1e3, top), cmap=MAP, vmin=0, vmax=top, rasterized=True)
    figure.colorbar(mesh, ax=axes, label=BAR)
    axes.yaxis.set_major_locator(AutoDateLocator())
    axes.yaxis.set_major_formatter(DateFormatter("%Y-%m-%d" if np.ptp(rows) > SHORT else "%Y-%m-%d %H:%M"))
    axes.set(title=title, xlabel="spindle speed (rpm)", ylabel="date", xlim=(speed_rpm[0], speed_rpm[-1]))
    axes.grid(visible=False)
    return figure


def radial_figure(lobes: RadialLobes, diameter: float, present: float, title: str = "") -> Figure:
    """Limiting depth over speed and radial depth for a cutter of this diameter (m), as a map with lines.

    present is the immersion (radial depth over diameter) of the cut itself, a dashed line. The contours are those of
    one over depth, which is smooth where a pocket has no limit.
    """
    figure, (axes,) = new_axes(1, (8.0, 4.2))
    depths = np.asarray(MaxNLocator(LEVELS).tick_values(0, _top(lobes.depth)))[1:]
    radial, softness = lobes.immersion * diameter * 1e3, 1e-3 / lobes.depth
    levels = 1 / depths[::-1]
    colours = colormaps[MAP](np.linspace(1, 0, levels.size + 1))
    mesh = axes.contourf(lobes.speed_rpm, radial, softness, levels=levels, colors=colours, extend="both")
    axes.contour(lobes.speed_rpm, radial, softness, levels=levels, colors="black", linewidths=0.3)
    axes.axhline(present * diameter * 1e3, color=ALARM, ls="--", lw=2, clip_on=False)
    bar = figure.colorbar(mesh, ax=axes, spacing="uniform", label=BAR)
    bar.ax.invert_yaxis()
    bar.set_ticks(levels.tolist(), labels=[f"{depth:g}" for depth in depths[::-1]])
    if lobes.remarks:
        figure.supxlabel(fill("; ".join(map(str, lobes.remarks)), 120), fontsize=8)
    axes.set(title=title, xlabel="spindle speed (rpm)", ylabel="radial depth (mm); dashed: now")
    axes.grid(visible=False)
    return figure


def _edges(middles: Floats, alone: float) -> Floats:
    """Edges of cells around their middles; a cell that stands alone has this width."""
    halves = np.diff(middles) / 2 if middles.size > 1 else np.array([alone / 2])
    inner = middles[:-1] + halves[: middles.size - 1]
    return np.concatenate((middles[:1] - halves[0], inner, middles[-1:] + halves[-1]))


def _top(depth: Floats) -> float:
    """Depth (mm) at which a map of depths (m) ends."""
    finite = depth[np.isfinite(depth)] * 1e3
    return min(6 * float(finite.min()), float(finite.max())) if finite.size else 1.0


def _draw_learnt(axes: Axes, learnt: LobesAtSpeed, deepest: float) -> None:
    """Line and band of the spindle at speed; depths (mm) end at the deepest."""
    label = f"at speed, learnt from {learnt.cuts} test cut{'s' if learnt.cuts > 1 else ''}"
    left = "98 % of what test cuts have left open"
    low, high = (np.minimum(edge * 1e3, deepest) for edge in (learnt.band.low, learnt.band.high))
    axes.fill_between(learnt.band.speed_rpm, low, high, color=LEARNT, alpha=0.25, lw=0, label=left)
    axes.plot(learnt.lobes.speed_rpm, learnt.lobes.depth * 1e3, color=LEARNT, ls="-.", lw=1.6, label=label)


def _draw_marks(
    axes: Axes, programs: Sequence[Verdict], pockets: Sequence[Setting], heard: Sequence[HeardCut], is_small: bool
) -> None:
    """What stands on the lobes; the words of a small picture are names of programs, as far as there is room."""
    labels = PictureLabels(axes, PHONE, may_lack=True) if is_small else PictureLabels(axes)
    draw_heard(axes, heard, labels)
    for i, pocket in enumerate(pockets):
        _draw_pocket(axes, pocket, labels, WINDOW if i == 0 else "")
    for program in programs:
        _draw_program(axes, program, labels)
    for pocket in () if is_small else pockets:
        text = f"{pocket.speed_rpm:.0f} rpm\n{pocket.depth_mm:.2f} mm"
        labels.add(text, (pocket.speed_rpm, pocket.depth_mm), SAFE, ("above", "right", "left"))
    for program in programs:
        name, place = program.program.name, _place(program)
        labels.add(name if is_small else f"{name}\n{program.word}", place)


def _draw_pocket(axes: Axes, pocket: Setting, labels: PictureLabels, label: str) -> None:
    """A box as wide as the window and as high as the depth."""
    low, high = pocket.window_rpm
    box = Rectangle((low, 0), high - low, pocket.depth_mm, fc="white", ec=SAFE, lw=1.2, hatch="////", label=label)
    axes.add_patch(box)
    labels.keep_free((low, 0.0), (high, pocket.depth_mm))


def _draw_program(axes: Axes, verdict: Verdict, labels: PictureLabels) -> None:
    colour, mark = MARKS[verdict.word]
    axes.plot(*_place(verdict), mark, color=colour, ms=MARK_SIZE, mec="white")
    labels.keep_clear(_place(verdict), MARK_SIZE)


def _place(verdict: Verdict) -> tuple[float, float]:
    """Speed (rpm) and depth (mm) of a program."""
    return verdict.program.speed_rpm, verdict.program.depth_mm


def heard_of(cuts: Sequence[HeardCut], name: str, tool: str, cut: Cut) -> list[HeardCut]:
    """Test cuts of this tool, cutter and immersion that count: of the cut of this name, or of the same coefficients."""
    alike = [heard for heard in cuts if heard.counts and heard.tool == tool and geometry(heard.cut) == geometry(cut)]
    force = cut.tangential, cut.radial
    return [heard for heard in alike if heard.program == name or (heard.cut.tangential, heard.cut.radial) == force]


def draw_heard(axes: Axes, cuts: Sequence[HeardCut], labels: PictureLabels) -> None:
    """A mark for each cut, with the frequency that it chattered at; before other words look for a place."""
    for chatters, (name, colour, mark) in HEARD_MARKS.items():
        marked = [cut for cut in cuts if cut.chatters == chatters]
        if marked:
            places = [cut.speed_rpm for cut in marked], [1e3 * cut.depth for cut in marked]
            axes.plot(*places, mark, color=colour, mfc="none", ms=HEARD_SIZE, mew=2.2, zorder=4, label=name)
    for cut in cuts:
        labels.keep_clear((cut.speed_rpm, 1e3 * cut.depth), HEARD_SIZE)
    for cut in cuts:
        if cut.chatter_frequency_hz is not None:
            labels.add(f"{cut.chatter_frequency_hz:.0f} Hz", (cut.speed_rpm, 1e3 * cut.depth), ALARM)
