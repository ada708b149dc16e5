"""Lines of numbers."""

from __future__ import annotations

from collections.abc import Container, Iterator

import numpy as np

from acquisition.lines.scans import Printed

SEPARATORS = bytes.maketrans(b";\t ", b",,,")
"""What may stand between numbers beside a comma."""
LONGEST = 200
"""Bytes of a line; what is longer is no line of numbers."""


class LineDecoder:
    """Finds rows of numbers in a stream of text."""

    def __init__(self, counts: Container[int] = (2, 3)) -> None:
        """counts: of numbers that a line may have. What stands before the first line end is not counted."""
        self._rest, self._begun, self._columns, self._broken, self._counts = b"", False, 0, 0, counts

    def feed(self, data: bytes) -> Iterator[Printed]:
        """The rows that are complete."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        self._rest = self._rest[-LONGEST:]
        if lines and not self._begun:
            self._begun, lines = True, lines[1:]
        rows: list[list[float]] = []
        for line in lines:
            row = _numbers(line)
            row = row if len(row) in self._counts else []
            self._columns = self._columns or len(row)
            if row and len(row) == self._columns:
                rows.append(row)
            elif line.strip():
                if rows:
                    yield self._printed(rows)
                rows, self._broken = [], self._broken + 1
        if rows:
            yield self._printed(rows)

    def _printed(self, rows: list[list[float]]) -> Printed:
        printed, self._broken = Printed(np.array(rows), self._broken), 0
        return printed


def _numbers(line: bytes) -> list[float]:
    """Finite numbers of a line; none where it holds anything else."""
    words = [word for word in line.strip().translate(SEPARATORS).split(b",") if word]
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        return []
    return numbers if np.isfinite(numbers).all() else []
