"""A section of the report: what it is made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from matplotlib.figure import Figure

from lobewatch.show.figures.style import svg
from lobewatch.show.report.figure_data import Numbers


class Paragraph(NamedTuple):
    """A sentence or a few."""

    text: str
    """Text; nothing is shown where it is empty."""
    is_small: bool = False
    """Whether it stands in small letters, as what is to be known beside."""


class BulletList(NamedTuple):
    """A list of lines."""

    lines: Sequence[str]
    """Text of each."""


class TableCell(NamedTuple):
    """A cell with the colour of a verdict or light."""

    text: str
    """Text of the cell."""
    kind: str
    """Class of the style sheet: ok, doubt or bad."""


class DataTable(NamedTuple):
    """A table."""

    heads: Sequence[str]
    """Headings of the columns, with units."""
    rows: Sequence[Sequence[str | TableCell]]
    """Cells of each row."""
    kind: str = ""
    """Classes of the style sheet: "words" for text to the left."""
    if_empty: str = ""
    """Text in place of the rows where there are none."""
    numbers: Numbers | None = None
    """The table with all digits, to be saved as CSV."""
    key: str = ""
    """Name of the numbers in the page."""


class Drawing(NamedTuple):
    """A picture."""

    svg: str
    """The <svg> element."""
    numbers: Numbers | None = None
    """Numbers of the picture, to be saved as CSV."""


class Fragment(NamedTuple):
    """A piece of the page with a template of its own."""

    template: str
    """File beside report.html."""
    content: Mapping[str, Any]
    """Values that the template shows."""


Part = Paragraph | BulletList | DataTable | Drawing | Fragment


class Section(NamedTuple):
    """A heading with what stands below it, each part on lines of its own."""

    heading: str
    """Heading; empty for none."""
    parts: Sequence[Part]
    """Parts below the heading, from above."""
    is_framed: bool = True
    """Whether a line end stands before and after it in the file; without any meaning on the page."""
    has_plot: bool = False
    """Whether the page must bring the script that plots."""


def picture_section(heading: str, text: str, figure: Figure, numbers: Numbers | None = None) -> Section:
    """A picture below what is to be known to read it; numbers: what is drawn."""
    return Section(heading, [Paragraph(text, is_small=True), Drawing(svg(figure), numbers)])
