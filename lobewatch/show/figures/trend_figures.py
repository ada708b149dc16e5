"""Every picture: the same colours for the same thing, told apart in grey too (dashes and marks)."""

from __future__ import annotations

import io
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from textwrap import shorten
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter, date2num
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import LogFormatter
from numpy.typing import NDArray

from acquisition import Frf
from lobewatch.machine.settings.setup_tables import Limits
from lobewatch.show.figures.course import TrendCurve
from lobewatch.show.terminal.output import printable

NOW = "#0072B2"
THEN = "#777777"
ALARM = "#D55E00"
GOOD = "#009E73"
UNKNOWN = "#767676"
EVENT = "#555555"
STYLE: dict[Any, Any] = {
    "font.size": 10,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "svg.hashsalt": "lobewatch",
    "svg.fonttype": "none",
    "text.parse_math": False,
}


class Marks(NamedTuple):
    """What stands beside a trend."""

    events: Sequence[tuple[datetime, str]] = ()
    """What was done, and when."""
    hollow: Sequence[tuple[datetime, float]] = ()
    """Values that do not count."""


NOTHING_ELSE = Marks()


def save_figure(figure: Figure, path: Path) -> None:
    """Write a picture in the format that the ending names; ValueError for one that is not known."""
    if path.suffix.lower() not in (".svg", ".png", ".pdf"):
        raise ValueError(
            f"{path}: a picture cannot end in {path.suffix!r}; name a file that ends in .svg, .png or .pdf"
        )
    _read_nothing_as_formula(figure)
    with mpl.rc_context(STYLE):
        figure.savefig(path, dpi=150)


def svg(figure: Figure) -> str:
    """The picture as an <svg> element."""
    text = io.StringIO()
    _read_nothing_as_formula(figure)
    with mpl.rc_context(STYLE):
        figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()[text.getvalue().index("<svg") :]


def _read_nothing_as_formula(figure: Figure) -> None:
    """Texts stand as they are: a program may be called "cost $5 to $6". Logarithmic axes have plain numbers then.

    Characters that no picture can hold are replaced.
    """
    for text in figure.findobj(Text):
        text.set_parse_math(False)
        text.set_text(printable(text.get_text()))
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis) if axis.get_scale() == "log"):
        axis.set_major_formatter(LogFormatter())
        axis.set_minor_formatter(LogFormatter(labelOnlyBase=False))


def frf_figure(then: Frf | None, now: Frf, band: tuple[float, float]) -> Figure:
    """Real and imaginary part of receptance and coherence, the newest and the first test."""
    rows = 2 if now.coherence is None else 3
    figure, axes = new_axes(rows, (8.0, 2.1 * rows))
    tests = [(now, "now", NOW, "-"), *([(then, "first", THEN, "--")] if then is not None else [])]
    for frf, label, colour, dashes in tests:
        inside = frf.in_band(band)
        style: dict[str, Any] = {"color": colour, "ls": dashes, "lw": 1.3, "label": label}
        axes[0].plot(inside.frequency, inside.receptance.real * 1e9, **style)
        axes[1].plot(inside.frequency, inside.receptance.imag * 1e9, **style)
        if rows == 3 and inside.coherence is not None:
            axes[2].plot(inside.frequency, inside.coherence, **style)
    axes[0].set(ylabel="Re (nm/N)")
    axes[1].set(ylabel="Im (nm/N)")
    if rows == 3:
        axes[2].set(ylabel="coherence", ylim=(min(0.9, axes[2].get_ylim()[0]), 1.005))
    axes[-1].set(xlabel="frequency (Hz)", xlim=band)
    axes[0].legend(loc="upper right", ncols=2)
    return figure


def trend_figure(
    times: Sequence[datetime],
    values: NDArray[np.float64],
    stds: NDArray[np.float64],
    label: str,
    limits: Limits | None = None,
    marks: Marks = NOTHING_ELSE,
    course: TrendCurve | None = None,
) -> Figure:
    """A value over time with its 95 % interval; with limits, where its fall calls for attention.

    limits: in % of the first value of the course, else of the first value.
    """
    figure, (axes,) = new_axes(1, (8.0, 2.8))
    days = date2num(times)
    axes.errorbar(days, values, yerr=1.96 * np.nan_to_num(stds), fmt="o", ms=4, color=NOW, capsize=2)
    if limits is not None:
        for percent, colour, dashes in (
            (limits.frequency_warn_percent, THEN, "--"),
            (limits.frequency_alarm_percent, ALARM, "-"),
        ):
            level = (values[0] if course is None else course.line[0]) * (1 - percent / 100)
            axes.axhline(level, color=colour, ls=dashes, lw=1)
            axes.annotate(
                f"-{percent:g} %", (1, level), xycoords=("axes fraction", "data"), ha="right", va="bottom", color=colour
            )
    if len(days) == 1:
        axes.set_xlim(days[0] - 15, days[0] + 15)
    if course is not None:
        axes.plot(course.days, course.line, color=NOW, lw=1)
        axes.fill_between(course.days_ahead, course.low, course.high, color=NOW, alpha=0.2, lw=0)
    _add_marks(axes, marks)
    locator = AutoDateLocator()
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(ConciseDateFormatter(locator))
    axes.set(ylabel=label)
    axes.margins(y=0.12)
    return figure


def _add_marks(axes: Axes, marks: Marks) -> None:
    if marks.hollow:
        days = date2num([time for time, _ in marks.hollow])
        axes.plot(days, [value for _, value in marks.hollow], "o", ms=5, mfc="none", mec=NOW)
    for time, text in marks.events:
        day = date2num(time)
        axes.axvline(day, color=EVENT, ls=":", lw=1)
        place: dict[str, Any] = {"xytext": (2, 2), "textcoords": "offset points", "rotation": 90, "fontsize": 8}
        axes.annotate(
            shorten(text, 26, placeholder="…"), (day, 0), xycoords=("data", "axes fraction"), va="bottom", **place
        )


def new_axes(rows: int, size: tuple[float, float]) -> tuple[Figure, list[Axes]]:
    """A figure of this size (inches) with rows of axes, one above the other."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.subplots(rows, 1, sharex=True, squeeze=False)
    return figure, list(axes[:, 0])
