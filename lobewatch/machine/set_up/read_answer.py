"""Answers as people type them: numbers with or without their units, decimal comma or point."""

from __future__ import annotations

import re
from collections.abc import Sequence

OPEN = "-"
"""Answer that leaves something open."""
UNITS = (
    "rpm",
    "1/min",
    "mm",
    "mm/tooth",
    "deg",
    "°",
    "kw",
    "nm",
    "n·m",
    "mv/n",
    "mv/g",
    "g",
    "v",
    "teeth",
    "flutes",
    "x",
)
"""Words that may stand between numbers."""
NUMBER = re.compile(r"\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?")


def is_open(answer: str) -> bool:
    """Whether an answer leaves it open."""
    return answer.strip().casefold() in (OPEN, "none", "no", "not known", "unknown")


def read_numbers(answer: str, names: Sequence[str], least: int | None = None) -> list[float]:
    """Numbers of an answer, as many as there are names, or at least so many; ValueError that names them."""
    words = NUMBER.sub(" ", answer)
    strange = [word for word in re.split(r"[\s,;]+", words) if word and word.casefold() not in UNITS]
    if strange:
        raise ValueError(f"{answer!r}: what is {strange[0]!r}? Wanted are numbers alone: {', '.join(names)}")
    numbers = [float(number.replace(",", ".")) for number in NUMBER.findall(answer)]
    if not (len(names) if least is None else least) <= len(numbers) <= len(names):
        count = "1 number" if len(numbers) == 1 else f"{len(numbers)} numbers"
        raise ValueError(f"{answer!r}: {count}; wanted are, with blanks between them: {', '.join(names)}")
    return numbers


def number_text(value: float) -> str:
    """A number as it is typed."""
    return f"{value:.10g}"
