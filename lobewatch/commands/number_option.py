"""Numbers of options, which are written with a point."""

from __future__ import annotations

import re

import typer


def number(text: str | float) -> float:
    """A number as it is typed; typer.BadParameter for what is none, with the point for a decimal comma."""
    try:
        return float(text)
    except ValueError:
        comma = re.fullmatch(r"\s*([+-]?\d+),(\d+)\s*", str(text))
        hint = f"; write {comma[1]}.{comma[2]} with a point" if comma else ""
        raise typer.BadParameter(f"{text!r} is no number{hint}") from None
