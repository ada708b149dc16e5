"""The text of a file, whatever its encoding."""

from __future__ import annotations

import codecs
from pathlib import Path

_WIDE = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


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


def is_text(head: bytes) -> bool:
    """Whether these first bytes can be those of a text."""
    return head.startswith(_WIDE) or b"\x00" not in head
