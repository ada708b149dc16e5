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
"""In a row, or as the two parts of a complex one."""
TEXT_HEAD_SIZE = 65536
"""Bytes of a file that tell whether it has numbers."""


def read_text(path: Path) -> str:
    """UTF-8, UTF-16 with its mark or without, else Latin-1, in which every byte is a character."""
    return decode_text(path.read_bytes())


def decode_text(content: bytes) -> str:
    """The same of the bytes of a file, or of its first ones."""
    encoding = _detect_utf16(content[:TEXT_HEAD_SIZE])
    return content.decode(encoding, errors="replace") if encoding else decode_utf8_or_latin1(content)


def decode_utf8_or_latin1(content: bytes) -> str:
    """UTF-8, else Latin-1."""
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


def _detect_utf16(head: bytes) -> str:
    """UTF-16, by its mark, or as of two bytes the same one is zero in most characters and never the other; else empty.

    Numbers, blanks and separators are such characters, in whatever language the words between them are.
    """
    if head.startswith(_UTF16_MARKS):
        return "utf-16"
    zeros = [head[parity::2].count(0) for parity in (0, 1)]
    if min(zeros) == 0 and 4 * max(zeros) > len(head):
        return "utf-16-le" if zeros[1] else "utf-16-be"
    return ""


def split_fields(line: str, separator: str) -> list[str]:
    """The words of a line; within quotes a separator is none, but in a line that stands in quotes as a whole."""
    words = [word.strip() for word in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]
    return split_fields(words[0], separator) if len(words) == 1 and separator in words[0] else words


def is_text(head: bytes) -> bool:
    """Whether these first bytes can be those of a text."""
    return b"\x00" not in head or bool(_detect_utf16(head))


def is_prose(path: Path) -> bool:
    """Whether a file is a text in which no line begins with two numbers, as notes that lie beside recordings.

    The first 64 kB are looked at; no file that is empty or cannot be read is prose.
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
    """Some lines of a file."""

    texts: Sequence[str]
    """Lines without their ends."""
    numbers: Sequence[int]
    """Number of each line, from 1 on."""

    def __getitem__(self, part: slice) -> NumberedLines:
        """Some of them."""
        return NumberedLines(self.texts[part], self.numbers[part])


def number_lines(text: str, skip: int) -> tuple[NumberedLines, list[str]]:
    """Those behind the first `skip` that are not empty, and what stands behind # in others."""
    texts = text.splitlines()[skip:]
    if "#" not in text and all(map(str.strip, texts)):
        return NumberedLines(texts, range(skip + 1, skip + len(texts) + 1)), []
    numbered = [(line, number) for number, line in enumerate(texts, skip + 1) if line.strip()]
    comments = [line.strip()[1:] for line, _ in numbered if line.lstrip().startswith("#")]
    numbered = [entry for entry in numbered if not entry[0].lstrip().startswith("#")]
    return NumberedLines([line for line, _ in numbered], [number for _, number in numbered]), comments
