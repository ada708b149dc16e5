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
    """UTF-8, UTF-16 with its mark or without, else Latin-1, in which every byte is a character."""
    return text_in(path.read_bytes())


def text_in(content: bytes) -> str:
    """The same of the bytes of a file, or of its first ones."""
    encoding = _wide_encoding(content[:HEAD])
    return content.decode(encoding, errors="replace") if encoding else decoded(content)


def decoded(content: bytes) -> str:
    """UTF-8, else Latin-1."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _wide_encoding(head: bytes) -> str:
    """UTF-16, by its mark, or as of two bytes the same one is zero in most characters and never the other; else empty.

    Numbers, blanks and separators are such characters, in whatever language the words between them are.
    """
    if head.startswith(_WIDE):
        return "utf-16"
    zeros = [head[parity::2].count(0) for parity in (0, 1)]
    if min(zeros) == 0 and 4 * max(zeros) > len(head):
        return "utf-16-le" if zeros[1] else "utf-16-be"
    return ""


def fields(line: str, separator: str) -> list[str]:
    """The words of a line; within quotes a separator is none, but in a line that stands in quotes as a whole."""
    words = [word.strip() for word in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]
    return fields(words[0], separator) if len(words) == 1 and separator in words[0] else words


def is_text(head: bytes) -> bool:
    """Whether these first bytes can be those of a text."""
    return b"\x00" not in head or bool(_wide_encoding(head))


def is_prose(path: Path) -> bool:
    """Whether a file is a text in which no line begins with two numbers, as notes that lie beside recordings.

    The first 64 kB are looked at; no file that is empty or cannot be read is prose.
    """
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
    except OSError:
        return False
    text = text_in(head)
    return bool(text.strip()) and is_text(head) and _TWO_NUMBERS.search(text) is None
