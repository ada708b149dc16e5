"""Parts of a report section, and the numbers that go with its figures and tables."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np
from matplotlib.figure import Figure

from acquisition import Frf
from lobewatch.arrays import Floats
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
    def from_lobes(cls, speed_rpm: Floats, depths: Mapping[str, Floats]) -> Self:
        """Tabulate limiting depths (m, by name) over speed."""
        heads = ["speed (rpm)", *(f"{name}: limiting depth (mm)" for name in depths)]
        columns = np.column_stack([speed_rpm, *(1e3 * depth for depth in depths.values())])
        return cls(heads, columns[:: math.ceil(speed_rpm.size / MAX_FIGURE_LINES)].tolist())

    @classmethod
    def from_response(cls, frf: Frf) -> Self:
        """Tabulate a frequency response and its coherence, in no more lines than a figure can show."""
        coherence = np.full(frf.frequency.size, np.nan) if frf.coherence is None else frf.coherence
        columns = np.column_stack([frf.frequency, frf.receptance.real * 1e9, frf.receptance.imag * 1e9, coherence])
        step = math.ceil(frf.frequency.size / MAX_FIGURE_LINES)
        return cls(["frequency (Hz)", "Re (nm/N)", "Im (nm/N)", "coherence"], columns[::step].tolist())


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
    """Text of each item."""


class TableCell(NamedTuple):
    """Cell with the paint of a verdict or status."""

    text: str
    """Text of the cell."""
    kind: str
    """Class of the style sheet: ok, doubt or bad."""


class DataTable(NamedTuple):
    """Table."""

    heads: Sequence[str]
    """Headings of the columns, with units."""
    rows: Sequence[Sequence[str | TableCell]]
    """Cells of each row."""
    kind: str = ""
    """Classes of the style sheet: "words" aligns text to the left."""
    if_empty: str = ""
    """Text instead of rows where there are none."""
    numbers: NumberTable | None = None
    """Table with all digits, to be saved as CSV."""
    key: str = ""
    """Name of the numbers in the page."""


class Drawing(NamedTuple):
    """Figure."""

    svg: str
    """The <svg> element."""
    numbers: NumberTable | None = None
    """Numbers of the figure, to be saved as CSV."""


class Fragment(NamedTuple):
    """Part of the page with a template of its own."""

    template: str
    """Template file in this folder."""
    content: Mapping[str, Any]
    """Values that the template shows."""


SectionPart = Paragraph | BulletList | DataTable | Drawing | Fragment


class Section(NamedTuple):
    """Heading with the parts below it."""

    heading: str
    """Heading; empty for none."""
    parts: Sequence[SectionPart]
    """Parts below the heading, from the top."""
    is_framed: bool = True
    """True if blank lines surround it in the file, without any effect on the page."""
    has_plot: bool = False
    """True if the page needs the plot script."""

    @classmethod
    def with_figure(cls, heading: str, text: str, figure: Figure, numbers: NumberTable | None = None) -> Self:
        """Make a section of a figure below a note on reading it; numbers: data of the figure."""
        return cls(heading, [Paragraph(text, is_small=True), Drawing(render_svg(figure), numbers)])
