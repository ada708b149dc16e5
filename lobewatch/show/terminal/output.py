"""Print results as text, JSON or CSV on stdout, and notes on stderr.

Names and texts may come from anywhere: no control character of theirs reaches the terminal.
"""

import json
import math
import os
import re
import sys
import webbrowser
from collections.abc import Container, Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import starmap
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType
from rich.highlighter import JSONHighlighter
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from acquisition import Remark, merge_remarks
from acquisition.credentials import hide_passwords
from acquisition.errors import CONTROL_CHARACTERS
from lobewatch.machine.settings.display_units import metric_output
from lobewatch.show.terminal.option_names import with_option_names, with_option_names_inside

if TYPE_CHECKING:
    from rich.progress import Progress


def _keep_metric(ctx: typer.Context, is_json: bool) -> bool:
    if is_json:
        ctx.with_resource(metric_output())
    return is_json


Json = Annotated[bool, typer.Option("--json", callback=_keep_metric, is_eager=True, help="JSON on stdout.")]

JsonObject = dict[str, Any]
"""Object of the JSON output."""
Texts = list[str | Table]
"""Texts and tables of the output for people."""


class SafeConsole(Console):
    """Console that texts cannot control: newline and tab are the only control characters that pass."""

    @property
    def is_terminal(self) -> bool:
        """True for a terminal that is not quiet: with --quiet nobody is asked, and no progress is shown."""
        return super().is_terminal and not getattr(self, "quiet", False)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterator[Segment]:
        """Render without control characters, except those that rich itself writes."""
        for piece in super().render(renderable, options):
            yield piece if piece.control else piece._replace(text=make_printable(piece.text))


class SafeTable(Table):
    """Table whose rows cannot be broken: newline and tab do not pass, either."""

    def add_row(self, *cells: RenderableType | None, **options: Any) -> None:
        """Add a row."""
        super().add_row(*(make_printable(cell, "") if isinstance(cell, str) else cell for cell in cells), **options)

    @property
    def min_table_width(self) -> int:
        """Smallest width (characters) that leaves a word for each column that wraps; 0 for any width."""
        breaking = sum(not column.no_wrap for column in self.columns)
        whole = ([column.header, *column.cells] for column in self.columns if column.no_wrap)
        texts = ("\n".join(Text.from_markup(cell).plain for cell in cells if isinstance(cell, str)) for cells in whole)
        widths = (max(map(cell_len, text.split("\n"))) for text in texts)
        return sum(widths) + breaking * MIN_COLUMN_WIDTH + COLUMN_GAP * (len(self.columns) - 1) if breaking else 0


MIN_COLUMN_WIDTH = 10
"""Smallest width of a column that wraps (characters)."""
COLUMN_GAP = 2
"""Gap between columns (characters)."""
notes = SafeConsole(stderr=True, highlight=False, soft_wrap=True, emoji=False)
"""Console for progress and remarks."""
results = SafeConsole(highlight=False, soft_wrap=True, emoji=False, width=max(Console().width, 120))
"""Console for results, wide enough for every table: a narrow terminal may wrap lines, but no number is cut off."""


def emit(payload: JsonObject, as_json: bool, *texts: str | Table) -> None:
    """Print one JSON object, or the texts and tables; records in it become objects, infinite and NaN become null."""
    if as_json:
        exact = hide_passwords(json.dumps(plain_json(payload), allow_nan=False, indent=2, ensure_ascii=False))
        # newlines are only between lines
        exact = CONTROL_CHARACTERS.sub(lambda match: match[0] if match[0] == "\n" else f"\\u{ord(match[0]):04x}", exact)
        if results.is_terminal:
            results.print(JSONHighlighter()(exact), no_wrap=True, soft_wrap=True)
        else:
            results.out(exact, highlight=False)
        return
    for text in texts:
        if isinstance(text, str):
            results.file.write(f"{make_printable(text)}\n")
        else:
            width = text.min_table_width if isinstance(text, SafeTable) else 0
            results.print(text, width=max(Console().width, width) if width else None)


def plain_json(payload: JsonObject) -> JsonObject:
    """Return an object as JSON knows it: records become objects, infinite and NaN become null."""
    import msgspec  # only JSON output waits for it

    plain: JsonObject = with_option_names_inside(msgspec.to_builtins(payload, enc_hook=lambda array: array.tolist()))
    return plain


def print_always(text: str) -> None:
    """Print a line to stderr, also with --quiet."""
    sys.stderr.write(f"{make_printable(text)}\n")
    sys.stderr.flush()


@contextmanager
def show_progress(text: str) -> "Iterator[Progress]":
    """Show progress on stderr if that is a terminal, beginning with a task of unknown length."""
    from rich.progress import Progress

    with Progress(console=notes, transient=True, disable=not notes.is_terminal) as progress:
        progress.add_task(text, total=None)
        yield progress


def new_table(*headings: str, rows: Iterable[Iterable[str]] = ()) -> Table:
    """Return a table; a heading that begins with "<" names a column of text, with "~" one that may be wrapped."""
    table = SafeTable(box=None, pad_edge=False, header_style="bold")
    for heading in headings:
        wraps = heading.startswith("~")
        justify: Literal["left", "right"] = "left" if wraps or heading.startswith("<") else "right"
        table.add_column(heading.lstrip("<~"), justify=justify, no_wrap=not wraps, overflow="fold")
    for row in rows:
        table.add_row(*row)
    return table


def align_columns(rows: Sequence[Sequence[str]], numbers: Container[int] = ()) -> list[str]:
    """Return a line of text for each row, its cells as wide as their columns; numbers: columns to align right."""
    widths = [max(map(cell_len, column)) for column in zip(*rows, strict=True)]

    def align(column: int, cell: str) -> str:
        gap = " " * (widths[column] - cell_len(cell))
        return gap + cell if column in numbers else cell + gap

    return ["  ".join(starmap(align, enumerate(row))).rstrip() for row in rows]


def count_noun(count: int, noun: str) -> str:
    """Return a number and its noun, in the plural except for one.

    >>> count_noun(1, "cut"), count_noun(3, "cut")
    ('1 cut', '3 cuts')
    """
    return f"{count} {noun}{'' if count == 1 else 's'}"


def make_printable(text: str, kept: str = "\n\t") -> str:
    """Replace control characters except those to keep, hide passwords, and name options instead of library fields."""
    named = hide_passwords(with_option_names(text))
    return CONTROL_CHARACTERS.sub(lambda match: match[0] if match[0] in kept else "\ufffd", named)


def pick(record: Any, *names: str) -> JsonObject:
    """Return attributes of a record by their names; None for each where there is no record.

    >>> from fractions import Fraction
    >>> pick(Fraction(2, 3), "numerator", "denominator")
    {'numerator': 2, 'denominator': 3}
    """
    return {name: record if record is None else getattr(record, name) for name in names}


def remark_lines(remarks: Sequence[Remark]) -> list[str]:
    """Return a line for each remark, the same remark on several things as one."""
    return [f"note: {remark}" for remark in merge_remarks(remarks)]


def print_remarks(remarks: Iterable[Remark]) -> None:
    """Print remarks to stderr, a line each."""
    for remark in remarks:
        notes.print(f"note: {remark}", markup=False)


FORMULA_START = re.compile(r"(?![+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?\Z)[=+\-@\t\r]")
"""Beginning of a text that a spreadsheet reads as a formula, never of a number; as in report.js."""


def format_csv(lines: Iterable[Sequence[Any]]) -> str:
    """Return a CSV table, its headings first."""
    return "".join(",".join(map(format_csv_cell, line)) + "\n" for line in lines)


def format_csv_cell(value: Any) -> str:
    """Return one cell, empty for None; an apostrophe keeps a text that would be a formula a text."""
    text = "" if value is None else with_option_names(str(value))
    if isinstance(value, str) and FORMULA_START.match(text):
        text = f"'{text}"
    return '"{}"'.format(text.replace('"', '""')) if re.search('[",\r\n]', text) else text


def blank_nonfinite(value: Any) -> Any:
    """Return an empty text for NaN and infinity, other values as they are."""
    return "" if isinstance(value, float) and not math.isfinite(value) else value


Listen = Annotated[str, typer.Option(help="IP address to listen on. 0.0.0.0: all addresses.")]
HttpPort = Annotated[int, typer.Option(min=0, max=65535, help="HTTP port. 0: any free port.")]
Token = Annotated[str | None, typer.Option(help="Full-access token. Default: random.")]
WatchToken = Annotated[str | None, typer.Option(help="Read-only access token. Default: random.")]


def show_address(url: str, watch_url: str, as_json: bool = False) -> None:
    """Print the full-access and the read-only address. On a desktop, open the first in a browser."""
    if as_json:
        results.print(json.dumps({"url": url, "watch_url": watch_url}), markup=False)
        results.file.flush()
    else:
        print_always(f"screen: {url}\nread-only: {watch_url}")
    display = sys.platform in ("win32", "darwin") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if sys.stdout.isatty() and display:
        webbrowser.open(url)
