"""Results on stdout, as text for people or as one JSON object; progress and notes on stderr."""

from __future__ import annotations

import json
import math
from typing import Annotated, Any, Literal

import typer
from rich.console import Console
from rich.table import Table

Json = Annotated[bool, typer.Option("--json", help="One JSON object on stdout instead of text.")]

notes = Console(stderr=True, highlight=False, soft_wrap=True, emoji=False)
"""Progress and remarks."""
results = Console(highlight=False, soft_wrap=True, emoji=False, width=max(Console().width, 120))
"""What was asked for; wide enough for every table: a narrow terminal may break lines, but no number is cut off."""


def emit(payload: dict[str, Any], as_json: bool, *texts: str | Table) -> None:
    """One JSON object (numbers that are not finite become null), or the texts and tables."""
    if as_json:
        results.print_json(json.dumps(_finite(payload), allow_nan=False))
        return
    for text in texts:
        results.print(text, markup=False) if isinstance(text, str) else results.print(text)


def table(*headings: str) -> Table:
    """An empty table; a heading that begins with "<" names a column of text."""
    made = Table(box=None, pad_edge=False, header_style="bold")
    for heading in headings:
        justify: Literal["left", "right"] = "left" if heading.startswith("<") else "right"
        made.add_column(heading.removeprefix("<"), justify=justify, no_wrap=True)
    return made


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    if hasattr(value, "tolist"):
        return _finite(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value
