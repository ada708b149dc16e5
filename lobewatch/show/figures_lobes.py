"""Pictures of stability lobes, in the colours of figures.py."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, DateFormatter, date2num
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from lobes import DepthBand, Pocket, RadialLobes
from lobes.pockets import SHARE
from lobewatch.analysis import Verdict, Word
from lobewatch.show.figures import ALARM, GOOD, NOW, THEN, UNKNOWN, new_axes

Floats = NDArray[np.float64]

MAP = "cividis"
"""Colours of depth: dark is shallow, bright is deep, in grey too."""
SPREAD = "#E6E6E6"
MARKS = {Word.STABLE: (GOOD, "o"), Word.NOT_STABLE: (ALARM, "X"), Word.UNKNOWN: (UNKNOWN, "D")}
"""Colour and mark of a program by the verdict on it."""
LEVELS = 12
"""Steps of colour in a map."""
BAR = "limiting depth (mm); brightest: this or more"
SHORT = 10.0
"""Days below which dates are told with their time."""


def lobes_figure(
    speed_rpm: Floats,
    depths: Mapping[str, Floats],
    programs: Sequence[Verdict] = (),
    title: str = "",
    band: DepthBand | None = None,
    spread: DepthBand | None = None,
    pockets: Sequence[Pocket] = (),
) -> Figure:
    """Stability lobe diagram: the last of `depths` (m, by label) is now, those before it are earlier ones.

    band is the 95 % band of the measurement, spread the range of the published cutting coefficients.
    """
    figure, (axes,) = new_axes(1, (8.0, 4.2))
    *earlier, now = depths.items()
    finite = now[1][np.isfinite(now[1])] * 1e3
    top = max([5 * float(finite.min()) if finite.size else 1.0, *(1.3 * one.program.depth_mm for one in programs)])
    if spread is not None:
        _fill(axes, speed_rpm, spread, top, color=SPREAD, label="range of published coefficients", zorder=0.5)
    for label, depth in earlier:
        axes.plot(speed_rpm, depth * 1e3, color=THEN, ls="--", lw=1.2, label=label)
    axes.plot(speed_rpm, now[1] * 1e3, color=NOW, lw=1.6, label=now[0])
    if band is not None:
        _fill(axes, speed_rpm, band, top, color=NOW, alpha=0.35, label="95 % band of the tap")
    axes.fill_between(speed_rpm, np.minimum(now[1] * 1e3, top), top, color=NOW, alpha=0.10, lw=0)
    axes.set(ylim=(0, top), xlim=(speed_rpm[0], speed_rpm[-1]), title=title)
    for i, pocket in enumerate(pockets):
        _draw_pocket(axes, pocket, f"pocket, at least {100 * SHARE:.0f} % as deep" if i == 0 else "")
    for program in programs:
        _draw_program(axes, program)
    axes.set(xlabel="spindle speed (rpm)", ylabel="limiting depth (mm)")
    figure.legend(loc="outside lower center", ncols=4, frameon=False, fontsize=9)
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


def _fill(axes: Axes, speed_rpm: Floats, band: DepthBand, top: float, **style: Any) -> None:
    """A band between its edges, cut off above the picture."""
    low, high = (np.minimum(edge * 1e3, 2 * top) for edge in band)
    axes.fill_between(speed_rpm, low, high, lw=0, **style)


def _draw_pocket(axes: Axes, pocket: Pocket, label: str) -> None:
    """A line at the speed of a pocket, with the speed at its foot, and a bar as wide as the pocket."""
    axes.axvline(pocket.speed_rpm, color=NOW, ls=":", lw=1)
    ends, depth = (pocket.from_rpm, pocket.to_rpm), SHARE * pocket.depth * 1e3
    axes.plot(ends, (depth, depth), color=NOW, lw=1, marker="|", ms=7, label=label)
    axes.annotate(
        f"{pocket.speed_rpm:.0f} rpm",
        (pocket.speed_rpm, 0.02),
        xycoords=("data", "axes fraction"),
        fontsize=8,
        ha="center",
        color=NOW,
        bbox={"color": "white", "alpha": 0.8, "pad": 1, "lw": 0},
    )


def _draw_program(axes: Axes, verdict: Verdict) -> None:
    colour, mark = MARKS[verdict.word]
    low, high = axes.get_xlim()
    place = (verdict.program.speed_rpm, verdict.program.depth_mm)
    is_left = place[0] > low + 0.8 * (high - low)
    axes.plot(*place, mark, color=colour, ms=9, mec="white")
    axes.annotate(
        verdict.program.name,
        place,
        xytext=(-7 if is_left else 7, 5),
        textcoords="offset points",
        ha="right" if is_left else "left",
        fontsize=9,
        bbox={"color": "white", "alpha": 0.7, "pad": 1, "lw": 0},
    )
