"""Decode text files and number their lines."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

_UTF16_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)
_NUMBER_PATTERN = r"[+-]?(?:\d+(?:[.,]\d*)?|\.\d+)(?:[eEdD][+-]?\d+)?"
_TWO_NUMBERS = re.compile(
    rf"^[\W_]*?{_NUMBER_PATTERN}(?:[ \t;,]+{_NUMBER_PATTERN}(?![.\w])|[ \t]*[+-][ \t]*{_NUMBER_PATTERN}[ij])",
    re.MULTILINE,
)
"""Two numbers in a row, or the two parts of a complex one."""
TEXT_HEAD_SIZE = 65536
"""Number of bytes of a file that show whether it has numbers."""


def read_text(path: Path) -> str:
    """Read a text in UTF-8, UTF-16 with or without its mark, else Latin-1, where every byte is a character."""
    return decode_text(path.read_bytes())


def decode_text(content: bytes) -> str:
    """Decode the bytes of a text file, or its first ones, as `read_text` does."""
    encoding = _detect_utf16(content[:TEXT_HEAD_SIZE])
    return content.decode(encoding, errors="replace") if encoding else decode_utf8_or_latin1(content)


def decode_utf8_or_latin1(content: bytes) -> str:
    """Decode UTF-8, else Latin-1."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _detect_utf16(head: bytes) -> str:
    """Detect UTF-16 by its mark, or by zero bytes at the same place of most characters; return its name, else "".

    Numbers, blanks and separators have such a zero byte, whatever the language of the words is.
    """
    if head.startswith(_UTF16_MARKS):
        return "utf-16"
    zeros = [head[parity::2].count(0) for parity in (0, 1)]
    if min(zeros) == 0 and 4 * max(zeros) > len(head):
        return "utf-16-le" if zeros[1] else "utf-16-be"
    return ""


def split_fields(line: str, separator: str) -> list[str]:
    """Split a line into words; quotes protect separators, unless they enclose the whole line."""
    words = [word.strip() for word in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]
    return split_fields(words[0], separator) if len(words) == 1 and separator in words[0] else words


def is_text(head: bytes) -> bool:
    """Return whether these first bytes can be those of a text."""
    return b"\x00" not in head or bool(_detect_utf16(head))


def is_prose(path: Path) -> bool:
    """Return whether a file is a text without a line that begins with two numbers, like notes next to recordings.

    The first 64 kB are checked. A file that is empty or cannot be read is no prose.
    """
    try:
        with path.open("rb") as file:
            head = file.read(TEXT_HEAD_SIZE)
    except OSError:
        return False
    text = decode_text(head)
    return bool(text.strip()) and is_text(head) and _TWO_NUMBERS.search(text) is None


@dataclass(frozen=True)
class NumberedLines:
    """Lines of a file with their numbers."""

    texts: Sequence[str]
    """Lines without their ends."""
    numbers: Sequence[int]
    """Number of each line, from 1."""

    def __getitem__(self, part: slice) -> NumberedLines:
        return NumberedLines(self.texts[part], self.numbers[part])


def number_lines(text: str, skip: int) -> tuple[NumberedLines, list[str]]:
    """Return the lines after the first `skip` that are not empty, and the comments behind # in others."""
    texts = text.splitlines()[skip:]
    if "#" not in text and all(map(str.strip, texts)):
        return NumberedLines(texts, range(skip + 1, skip + len(texts) + 1)), []
    numbered = [(line, number) for number, line in enumerate(texts, skip + 1) if line.strip()]
    comments = [line.strip()[1:] for line, _ in numbered if line.lstrip().startswith("#")]
    numbered = [entry for entry in numbered if not entry[0].lstrip().startswith("#")]
    return NumberedLines([line for line, _ in numbered], [number for _, number in numbered]), comments
