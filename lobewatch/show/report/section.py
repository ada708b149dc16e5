"""Parts of a report section, and the numbers that go with its figures and tables."""

import json
import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from matplotlib.figure import Figure

from acquisition import Frf
from lobewatch.arrays import Floats
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.show.figures.drawing import render_svg
from lobewatch.show.terminal.option_names import with_option_names

MAX_FIGURE_LINES = 1500
"""Largest number of lines of a response or a diagram."""


class NumberTable(NamedTuple):
    """Table of numbers behind a figure or table."""

    heads: Sequence[str]
    """Headings of the columns, with units."""
    lines: Sequence[Sequence[Any]]
    """Texts and numbers of each row."""

    @property
    def text(self) -> str:
        """Table as JSON that can be embedded in HTML, with null for infinite and NaN."""
        lines = [[_json_value(value) for value in line] for line in self.lines]
        exact = json.dumps({"heads": list(self.heads), "lines": lines}, ensure_ascii=False, separators=(",", ":"))
        return exact.replace("<", "\\u003c").replace("&", "\\u0026")

    @classmethod
    def from_lobes(cls, speed_rpm: Floats, depths: Iterable[tuple[str, Floats]]) -> Self:
        """Tabulate named limiting depths (m) over speed."""
        names, values = zip(*depths, strict=True)
        heads = ["speed (rpm)", *(f"{name}: limiting depth ({LENGTH.unit})" for name in names)]
        columns = np.column_stack([speed_rpm, *(1e3 * LENGTH.scale * depth for depth in values)])
        return cls(heads, columns[:: math.ceil(speed_rpm.size / MAX_FIGURE_LINES)].tolist())

    @classmethod
    def from_response(cls, frf: Frf) -> Self:
        """Tabulate a frequency response and its coherence, in no more lines than a figure can show."""
        coherence = np.full(frf.frequency.size, np.nan) if frf.coherence is None else frf.coherence
        size, phase = np.abs(frf.receptance) * 1e9, np.degrees(np.angle(frf.receptance))
        real, imaginary = frf.receptance.real * 1e9, frf.receptance.imag * 1e9
        columns = np.column_stack([frf.frequency, size, phase, real, imaginary, coherence])
        heads = ["frequency (Hz)", "receptance (nm/N)", "phase (°)", "Re (nm/N)", "Im (nm/N)", "coherence"]
        return cls(heads, columns[:: math.ceil(frf.frequency.size / MAX_FIGURE_LINES)].tolist())


def _json_value(value: Any) -> Any:
    if isinstance(value, float):
        return float(f"{value:.5g}") if math.isfinite(value) else None
    return with_option_names(value) if isinstance(value, str) else value


class Paragraph(NamedTuple):
    """Paragraph of text."""

    text: str
    """Text; an empty one is not shown."""
    is_small: bool = False
    """True if it is shown in small letters, as a note."""


class BulletList(NamedTuple):
    """Bullet list."""

    lines: Sequence[str]
    """Text of each item; without any, the list is not shown."""


class TableCell(NamedTuple):
    """Cell with the color of a verdict or status."""

    text: str
    """Text of the cell."""
    kind: str
    """Class of the style sheet: ok, doubt or bad."""


class DataTable(NamedTuple):
    """Table."""

    heads: Sequence[str]
    """Headings of the columns, with units."""
    rows: Sequence[Sequence[str | TableCell]]
    """Cells of each row; the first names the row."""
    kind: str = ""
    """Classes of the style sheet: "words" aligns text to the left."""
    if_empty: str = ""
    """Text shown if there are no rows."""
    numbers: NumberTable | None = None
    """Table with all digits, to be saved as CSV."""


class Drawing(NamedTuple):
    """Figure that shows the numbers under the pointer."""

    svg: str
    """The <svg> element."""
    numbers: NumberTable | None = None
    """Numbers of the figure, shown under the pointer and saved as CSV. The first column or "date" is the abscissa."""
    n_choices: int = 0
    """Number of last columns that are drawn one at a time, chosen with a slider."""

    @classmethod
    def of(cls, figure: Figure, numbers: NumberTable | None = None, n_choices: int = 0) -> Self:
        """Render a figure of one or more axes above each other, with an empty area over them in units of their data."""
        svg, axes = render_svg(figure), figure.axes
        (left, top), (right, bottom) = axes[0].get_position().corners()[1], axes[-1].get_position().corners()[2]
        wide, high = 72 * figure.get_size_inches()
        box = f'x="{left * wide:.2f}" y="{(1 - top) * high:.2f}" width="{(right - left) * wide:.2f}"'
        (first, last), (low, peak) = axes[0].get_xlim(), axes[0].get_ylim()
        data = f"{first:.9g} {-peak:.9g} {last - first:.9g} {peak - low:.9g}"
        area = f'<svg class="area" {box} height="{(top - bottom) * high:.2f}" viewBox="{data}"'
        return cls(svg.replace("</svg>", f'{area} preserveAspectRatio="none"/></svg>'), numbers, n_choices)


SectionPart = Paragraph | BulletList | DataTable | Drawing


class Section(NamedTuple):
    """Heading with the parts below it."""

    heading: str
    """Heading."""
    parts: Sequence[SectionPart]
    """Parts below the heading, from the top."""
    style: str = ""
    """Class of the style sheet: "folded" shows the heading until it is opened, "half" takes half of a wide page."""
