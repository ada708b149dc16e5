"""A format in a package of its own: text that begins with DUMMY, one hit, or an FRF where that is its second word."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from acquisition import Circumstances, DataError, Format, Frf, Hit

MAGIC = b"DUMMY"


def _is_it(head: bytes, _path: Path) -> bool:
    return head.startswith(MAGIC)


def _read(path: Path) -> list[Hit] | Frf:
    heading, *rows = path.read_text(encoding="ascii").splitlines()
    try:
        first, second, third = np.array([row.split() for row in rows], dtype=float).T
    except ValueError as error:
        raise DataError(f"{path}: {error}") from error
    if heading.split()[1] == "FRF":
        return Frf(first, second + 1j * third)
    return [Hit(second, third, 1 / (first[1] - first[0]))]


def _recorded_as(path: Path) -> Circumstances:
    return Circumstances("", datetime(2021, 5, 4, 12, 0, tzinfo=UTC), "dummy tool", "y")


DUMMY = Format("dummy", "recording of the dummy", (".dum",), _is_it, _read, _recorded_as)
