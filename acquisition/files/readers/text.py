"""The text of a file, whatever its encoding."""

from __future__ import annotations

import codecs
import csv
import re
from pathlib import Path

_WIDE = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_NUMBER = r"[+-]?(?:\d+(?:[.,]\d*)?|\.\d+)(?:[eEdD][+-]?\d+)?"
_TWO_NUMBERS = re.compile(
    rf"^[\W_]*?{_NUMBER}(?:[ \t;,]+{_NUMBER}(?![.\w])|[ \t]*[+-][ \t]*{_NUMBER}[ij])", re.MULTILINE
)
"""In a row, or as the two parts of a complex one."""
HEAD = 65536
"""Bytes of a file that tell whether it has numbers."""


def text_of(path: Path) -> str:
    """UTF-8, UTF-16 with its mark, else Latin-1, in which every byte is a character."""
    content = path.read_bytes()
    if content.startswith(_WIDE):
        return content.decode("utf-16", errors="replace")
    return decoded(content)


def decoded(content: bytes) -> str:
    """UTF-8, else Latin-1."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def fields(line: str, separator: str) -> list[str]:
    """The words of a line; within quotes a separator is none, but in a line that stands in quotes as a whole."""
    words = [word.strip() for word in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]
    return fields(words[0], separator) if len(words) == 1 and separator in words[0] else words


def is_text(head: bytes) -> bool:
    """Whether these first bytes can be those of a text."""
    return head.startswith(_WIDE) or b"\x00" not in head


def is_prose(path: Path) -> bool:
    """Whether a file is a text in which no line begins with two numbers, as notes that lie beside recordings.

    The first 64 kB are looked at; no file that is empty or cannot be read is prose.
    """
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
    except OSError:
        return False
    text = head.decode("utf-16", errors="ignore") if head.startswith(_WIDE) else decoded(head)
    return bool(text.strip()) and is_text(head) and _TWO_NUMBERS.search(text) is None
