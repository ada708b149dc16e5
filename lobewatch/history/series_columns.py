"""The rows of one series as columns: what is watched of it, all at once."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain, compress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from lobewatch.history.history import WATCHED, Row


class SeriesColumns(NamedTuple):
    """n rows, oldest first."""

    rows: tuple[Row, ...]
    """The rows themselves."""
    asked: NDArray[np.bool_]
    """Whether anything is asked about one that nobody has answered, shape (n,)."""
    values: NDArray[np.float64]
    """Those of `WATCHED`, each with its standard error, shape (n, 4, 2)."""

    def known(self, name: str, and_sure: bool = False) -> NDArray[np.bool_]:
        """Whether a row knows a value, and where that is wanted, nothing is asked about it, shape (n,)."""
        found = np.isfinite(self.values[:, WATCHED.index(name), 0])
        return found & ~self.asked if and_sure else found

    def rows_that(self, are: NDArray[np.bool_]) -> tuple[Row, ...]:
        """Some of the rows."""
        return self.rows if are.all() else tuple(compress(self.rows, are.tolist()))


def series_columns(rows: Sequence[Row]) -> SeriesColumns:
    """Of the rows of one tool and direction."""
    told: Any = chain.from_iterable(chain.from_iterable([row.watched for row in rows]))
    values = np.fromiter(told, np.float64, 2 * len(WATCHED) * len(rows)).reshape(-1, len(WATCHED), 2)
    return SeriesColumns(tuple(rows), np.array([bool(row.questions) for row in rows]), values)
