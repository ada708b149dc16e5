"""Colours, letters and files of every picture: one colour for one thing, told apart in grey too (dashes and marks)."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import LogFormatter

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


def new_axes(rows: int, size: tuple[float, float]) -> tuple[Figure, list[Axes]]:
    """A figure of this size (inches) with rows of axes, one above the other."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.subplots(rows, 1, sharex=True, squeeze=False)
    return figure, list(axes[:, 0])
