"""The text of machine.toml, and the tables in it before anything is known of them."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from acquisition import DataError
from acquisition.regular_file import read_regular

LARGEST = 200_000
"""Bytes of a machine.toml; chosen, some ten times that of a busy machine."""
DOTTED = re.compile(r"""(?:(?:(?<![\w-])[\w-]++|"[^"\n]*"|'[^'\n]*')\s*+\.\s*+){20}""")
"""A key of more parts than any has; reading takes their number squared."""


def toml_text(path: Path) -> str:
    """Text of a machine file, its line ends as one character; DataError where it is no UTF-8, OSError where it is no
    file, larger than any should be, or cannot be read."""
    try:
        return read_regular(path, LARGEST).decode("utf-8").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError as error:
        raise DataError(f"{path}: no UTF-8 text at byte {error.start}; save it as UTF-8") from error


def toml_tables(text: str) -> dict[str, Any]:
    """Tables of a machine file; tomllib.TOMLDecodeError where it is none, ValueError where they are nested too deep."""
    dotted = DOTTED.search(text)
    try:
        if dotted is not None:
            raise RecursionError
        return tomllib.loads(text)
    except RecursionError as error:
        line = "" if dotted is None else f" in line {text.count(chr(10), 0, dotted.start()) + 1}"
        raise ValueError(f"tables or arrays are nested too deep{line}; machine.toml needs four levels") from error
