"""Results on stdout, as text for people or as one JSON object; progress and notes on stderr.

Names and texts may come from anywhere: no control character of theirs reaches the terminal.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import Annotated, Any, Literal

import typer
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType
from rich.highlighter import JSONHighlighter
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from acquisition import Remark, joined
from acquisition.names import CONTROL

Json = Annotated[bool, typer.Option("--json", help="One JSON object on stdout instead of text.")]

INSTEAD = "\ufffd"
"""Character that is shown for a control character."""


class Terminal(Console):
    """A console that texts cannot steer: of all control characters in them, only newline and tab pass."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterator[Segment]:
        """What is printed, piece by piece; the pieces that rich itself steers the terminal with are marked as such."""
        for piece in super().render(renderable, options):
            yield piece if piece.control else piece._replace(text=printable(piece.text))


class Cells(Table):
    """A table whose rows cannot be broken: newline and tab do not pass either."""

    def add_row(self, *cells: RenderableType | None, **options: Any) -> None:
        """One row."""
        super().add_row(*(CONTROL.sub(INSTEAD, cell) if isinstance(cell, str) else cell for cell in cells), **options)

    @property
    def least_width(self) -> int:
        """Characters a line, so that columns that cannot be broken are whole and the others hold a word; 0: any."""
        breaking = sum(not column.no_wrap for column in self.columns)
        wholes = (_widest([column.header, *column.cells]) for column in self.columns if column.no_wrap)
        return sum(wholes) + breaking * SHORTEST + GAP * (len(self.columns) - 1) if breaking else 0


SHORTEST = 10
"""Characters that a column that can be broken has at least."""
GAP = 2
"""Between columns."""
notes = Terminal(stderr=True, highlight=False, soft_wrap=True, emoji=False)
"""Console for progress and remarks."""
results = Terminal(highlight=False, soft_wrap=True, emoji=False, width=max(Console().width, 120))
"""Console for results, wide enough for every table: a narrow terminal may break lines, but no number is cut off."""


def emit(payload: dict[str, Any], as_json: bool, *texts: str | Table) -> None:
    """One JSON object (numbers that are not finite become null), or the texts and tables."""
    if as_json:
        exact = CONTROL.sub(_escaped, json.dumps(_finite(payload), allow_nan=False, indent=2, ensure_ascii=False))
        if results.is_terminal:
            results.print(JSONHighlighter()(exact), no_wrap=True, soft_wrap=True)
        else:
            results.out(exact, highlight=False)
        return
    for text in texts:
        if isinstance(text, str):
            results.file.write(f"{printable(text)}\n")
            continue
        least = text.least_width if isinstance(text, Cells) else 0
        results.print(text, width=max(Console().width, least) if least else None)


def table(*headings: str) -> Table:
    """An empty table; a heading that begins with "<" names a column of text, with "~" one that may be broken."""
    rows = Cells(box=None, pad_edge=False, header_style="bold")
    for heading in headings:
        breaks = heading.startswith("~")
        justify: Literal["left", "right"] = "left" if breaks or heading.startswith("<") else "right"
        rows.add_column(heading.lstrip("<~"), justify=justify, no_wrap=not breaks, overflow="fold")
    return rows


def _widest(cells: Iterable[RenderableType]) -> int:
    texts = (Text.from_markup(cell).plain for cell in cells if isinstance(cell, str))
    return max(cell_len(line) for text in texts for line in text.split("\n"))


def printable(text: str) -> str:
    """A text whose control characters are replaced, but for newline and tab."""
    return CONTROL.sub(lambda match: match[0] if match[0] in "\n\t" else INSTEAD, text)


def _escaped(match: re.Match[str]) -> str:
    """A control character as JSON writes it inside of text; a newline stands between its lines only."""
    return match[0] if match[0] == "\n" else f"\\u{ord(match[0]):04x}"


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    if hasattr(value, "tolist"):
        return _finite(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def remark_json(remark: Remark) -> dict[str, str]:
    """One remark."""
    return {"code": remark.code, "about": remark.about, "text": remark.text, "cure": remark.cure}


def remark_lines(remarks: Sequence[Remark]) -> list[str]:
    """A line each; those that say the same of several things once."""
    return [f"note: {remark}" for remark in joined(remarks)]


def note_remarks(remarks: Iterable[Remark]) -> None:
    """Print remarks beside the results, a line each."""
    for remark in remarks:
        notes.print(f"note: {remark}", markup=False)
