"""Style, axes, files and label placement of all figures."""

import io
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import Any, Literal

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import LogFormatter
from matplotlib.transforms import Bbox

from acquisition.file_io import check_file_name
from lobewatch.show.terminal.output import make_printable


class Paint(StrEnum):
    """Paint of a thing in every figure, distinct in grey too by dashes and marks."""

    NEWEST = "#0072B2"
    FIRST = "#777777"
    ALARM = "#D55E00"
    GOOD = "#009E73"
    UNKNOWN = "#767676"
    EVENT = "#555555"


FIGURE_STYLE: dict[Any, Any] = {
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
    """Write a figure in the format of its file ending. ValueError for an unsupported ending."""
    if path.suffix.lower() not in (".svg", ".png", ".pdf"):
        raise ValueError(f"{path}: unsupported file type {path.suffix!r}. Use .svg, .png or .pdf.")
    check_file_name(path)
    _disable_math_text(figure)
    with mpl.rc_context(FIGURE_STYLE):
        figure.savefig(path, dpi=150)


def render_svg(figure: Figure) -> str:
    """Return the figure as an <svg> element."""
    text = io.StringIO()
    _disable_math_text(figure)
    with mpl.rc_context(FIGURE_STYLE):
        figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()[text.getvalue().index("<svg") :]


def lay_out(figure: Figure) -> None:
    """Give the axes the size that they will have in the file."""
    _disable_math_text(figure)
    figure.draw_without_rendering()


def _disable_math_text(figure: Figure) -> None:
    """Show texts as they are, without mathematical notation and control characters.

    A program may be called "cost $5 to $6". Logarithmic axes get plain numbers.
    """
    for text in figure.findobj(Text):
        text.set_parse_math(False)
        text.set_text(make_printable(text.get_text()))
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis) if axis.get_scale() == "log"):
        axis.set_major_formatter(LogFormatter())
        axis.set_minor_formatter(LogFormatter(labelOnlyBase=False))


def new_axes(rows: int, size: tuple[float, float], first_ratio: float = 1.0) -> tuple[Figure, list[Axes]]:
    """Return a figure of this size (inches) with rows of axes, the first one higher by a ratio."""
    with mpl.rc_context(FIGURE_STYLE):
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.subplots(rows, 1, sharex=True, squeeze=False, height_ratios=[first_ratio, *[1.0] * (rows - 1)])
    return figure, list(axes[:, 0])


Point = tuple[float, float]
LabelSide = Literal["right", "left", "above", "below"]
LABEL_SIDES: dict[LabelSide, tuple[int, int]] = {"right": (1, 0), "left": (-1, 0), "above": (0, 1), "below": (0, -1)}
LABEL_FONT_SIZE = 8.5
"""Font size of labels (points)."""
MAX_HIDDEN_SHARE = 0.15
"""Largest share of its area that a label may cover or leave the axes by."""
LETTER_WIDTH, LINE_HEIGHT = 0.62, 1.35
"""Largest width of a letter and height of a line, over the font size."""
LABEL_DISTANCE = 9.0
"""Distance from a point to its label (points)."""
LABEL_BACKGROUND = {"color": "white", "alpha": 0.75, "pad": 1, "lw": 0}
"""Background of labels that lie on lines."""


class LabelPlacer:
    """Labels of one figure that avoid each other; the limits of the axes are set before."""

    def __init__(self, axes: Axes, *, may_lack: bool = False) -> None:
        """Take the axes; may_lack: leave out labels without room."""
        self._axes = axes
        self._may_lack = may_lack
        self._taken: list[Bbox] = []

    def add(self, text: str, place: Point, color: str = "black", sides: Sequence[LabelSide] = (*LABEL_SIDES,)) -> None:
        """Add a label at the side of a point that has most room, the first of several equal sides."""
        boxes = {side: self._box(text, place, side) for side in sides}
        best = min(boxes, key=lambda side: self._covered(boxes[side]))
        if self._may_lack and self._covered(boxes[best]) > MAX_HIDDEN_SHARE * _area(boxes[best]):
            return
        self._taken.append(boxes[best])
        right, up = LABEL_SIDES[best]
        style: dict[str, Any] = {"textcoords": "offset points", "fontsize": LABEL_FONT_SIZE, "bbox": LABEL_BACKGROUND}
        style |= {"ha": {1: "left", -1: "right"}.get(right, "center"), "va": {1: "bottom", -1: "top"}.get(up, "center")}
        self._axes.annotate(text, place, (LABEL_DISTANCE * right, LABEL_DISTANCE * 2 / 3 * up), color=color, **style)

    def reserve_area(self, low: Point, high: Point) -> None:
        """Keep labels out of the rectangle between two corners if there is another place."""
        self._taken.append(Bbox.from_extents(*self._points(low), *self._points(high)))

    def reserve_mark(self, place: Point, size: float) -> None:
        """Keep labels off a mark of this size (points) if there is another place."""
        x, y = self._points(place)
        self._taken.append(Bbox.from_extents(x - size / 2, y - size / 2, x + size / 2, y + size / 2))

    def _box(self, text: str, place: Point, side: LabelSide) -> Bbox:
        lines, (right, up) = text.split("\n"), LABEL_SIDES[side]
        wide, high = LETTER_WIDTH * LABEL_FONT_SIZE * max(map(len, lines)), LINE_HEIGHT * LABEL_FONT_SIZE * len(lines)
        x, y = self._points(place)
        x, y = x + right * (LABEL_DISTANCE + wide / 2), y + up * (LABEL_DISTANCE * 2 / 3 + high / 2)
        return Bbox.from_extents(x - wide / 2, y - high / 2, x + wide / 2, y + high / 2)

    def _covered(self, box: Bbox) -> float:
        """Return the area of a box on other labels and outside of the axes."""
        inside = _area(Bbox.intersection(box, Bbox.from_extents(0, 0, *self._size)))
        return _area(box) - inside + sum(_area(Bbox.intersection(box, taken)) for taken in self._taken)

    def _points(self, place: Point) -> Point:
        (x, y), (wide, high) = place, self._size
        (left, right), (low, top) = self._axes.get_xlim(), self._axes.get_ylim()
        return (x - left) / (right - left) * wide, (y - low) / (top - low) * high

    @property
    def _size(self) -> Point:
        box = self._axes.get_window_extent()
        points = 72 / self._axes.figure.dpi
        return box.width * points, box.height * points


def _area(box: Bbox | None) -> float:
    return 0.0 if box is None else box.width * box.height
