"""Capitalize sentences, and wrap lists of them to lines that a narrow terminal shows in full."""

import re
import textwrap
from collections.abc import Iterable

from lobewatch.show.terminal.output import make_printable

MAX_LINE_LENGTH = 80
"""Largest length of a line of a list (characters)."""
KEPT_SPACE = "\ue000"
"""Space at which no line ends."""
COMMAND = re.compile(r"lobewatch [a-z]+(?:(?: \w+)? (?:-\S+|'[^']*'|\S*[/.]\S*\w|[a-z]+-[a-z-]+|[A-Z]{3,}\w*))*")
"""Command with its arguments, which is copied in one piece."""


def capitalize(text: str) -> str:
    """Return a text with a capital letter at its beginning.

    >>> capitalize("tap again")
    'Tap again'
    """
    return f"{text[:1].upper()}{text[1:]}"


def wrap_lines(texts: Iterable[str], indent: str = "  ") -> list[str]:
    """Return the lines of a list: each text begins with this indent, its further lines with two more spaces.

    A number stays in one line with its unit.
    """
    return [line for text in texts for line in _wrap(f"{indent}{make_printable(text)}")]


def _wrap(text: str) -> list[str]:
    indent = " " * (2 + len(text) - len(text.lstrip()))
    kept = COMMAND.sub(lambda match: match[0].replace(" ", KEPT_SPACE), text)
    kept = re.sub(r"(?<=[0-9]) ", KEPT_SPACE, kept)  # a line never ends between a number and its unit
    style = {"subsequent_indent": indent, "break_long_words": False, "break_on_hyphens": False}
    return [line.replace(KEPT_SPACE, " ") for line in textwrap.wrap(kept, MAX_LINE_LENGTH, **style)]  # type: ignore[arg-type]
