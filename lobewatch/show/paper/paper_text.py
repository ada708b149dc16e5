"""Show the comparison with the paper as text and JSON."""

import textwrap
from collections.abc import Iterator
from pathlib import Path

from lobewatch.paper import Comparison, PaperStudy
from lobewatch.show.terminal.output import JsonObject, pick

PAPER_COLUMN_WIDTHS = (32, 9, 10, 10, 5, 9)
"""Widths of the columns, 80 characters in all."""


def paper_json(study: PaperStudy, page: Path | None) -> JsonObject:
    """Return every number and every claim of the paper, and the page that was written."""
    return {
        "numbers": [
            {"section": section.title, **pick(row, "quantity", "where", "unit"), "paper": row.printed}
            | pick(row, "ours", "difference", "reason")
            for section in study.sections
            for row in section.comparisons
        ],
        "claims": [{"claim": claim.text, **pick(claim, "verdict", "evidence")} for claim in study.claims],
        "page": page and str(page),
    }


def paper_lines(study: PaperStudy, width: int) -> Iterator[str]:
    """Return a table of all numbers with reasons, and the claims, in lines of this width (characters)."""
    yield "Gaber & Hashemi, Shock and Vibration 2016, 4390185, compared with a surrogate"
    yield "spindle fitted to the paper's frequencies (its drawing is not public)."
    for section in study.sections:
        yield from ("", section.title, _table_line(("", "source", "paper", "ours", "unit", "deviation")))
        for row in section.comparisons:
            yield _table_line(paper_cells(row))
            yield from _indent(row.reason, width)
    yield from ("", "Claims of the paper, tested on the surrogate")
    for claim in study.claims:
        yield from textwrap.wrap(f"{claim.verdict}: {claim.text}", width)
        yield from _indent(claim.evidence, width)


def paper_cells(row: Comparison) -> tuple[str, str, str, str, str, str]:
    """Return quantity, place, both values, unit and difference."""
    printed = "-" if row.printed is None else number_text(row.printed, 7, whole=False)
    return row.quantity, row.where, printed, number_text(row.ours, row.digits), row.unit, difference_text(row)


def number_text(value: float, digits: int, *, whole: bool = True) -> str:
    """Return a number with significant digits; whole: with trailing zeros, too."""
    form = "#" if whole else ""
    if value == 0 or 1e-3 <= abs(value) < 1e6:
        return f"{value:{form}.{digits}g}".removesuffix(".")
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    return f"{float(mantissa):{form}.{digits}g}".removesuffix(".") + f"e{int(power)}"


def difference_text(row: Comparison) -> str:
    """Return our value minus that of the paper as a share of it, for percents in points."""
    if row.difference is None or row.printed is None:
        return ""
    if row.unit == "%":
        return f"{row.ours - row.printed:+.1f} pts"
    return "0" if abs(row.difference) < 5e-7 else f"{100 * row.difference:+.2g} %"


def _table_line(texts: tuple[str, ...]) -> str:
    columns = zip(texts, "<<>><>", PAPER_COLUMN_WIDTHS, strict=True)
    return " ".join(f"{text:{side}{width}}" for text, side, width in columns).rstrip()


def _indent(text: str, width: int) -> list[str]:
    return textwrap.wrap(text, width, initial_indent="    ", subsequent_indent="    ")
