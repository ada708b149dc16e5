"""A section of the report: what it is made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

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


class Drawing(NamedTuple):
    """A picture."""

    svg: str
    """The <svg> element."""


class Download(NamedTuple):
    """A button that saves numbers as CSV."""

    numbers: Numbers | None
    """The numbers; None for no button."""
    key: str = ""
    """Name of the numbers in the page; their place among those without one where not given."""


class Fragment(NamedTuple):
    """A piece of the page with a template of its own."""

    template: str
    """File beside report.html."""
    content: Mapping[str, Any]
    """Values that the template shows."""


Part = Paragraph | BulletList | DataTable | Drawing | Download | Fragment


class Section(NamedTuple):
    """A heading with what stands below it, each part on lines of its own."""

    heading: str
    """Heading; empty for none."""
    parts: Sequence[Part]
    """What is shown below it, from above."""
    is_framed: bool = True
    """Whether a line end stands before and after it in the file; without any meaning on the page."""
    has_plot: bool = False
    """Whether the page must bring the script that plots."""
