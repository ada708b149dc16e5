"""What the other machines of a plant told of the scatter of tap tests, as lines of the journal.

It is kept as it was known then, so that what is judged with it does not hang on the others later on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

import msgspec


class KnownScatter(msgspec.Struct, frozen=True):
    """Standard deviation (%) from clamping to clamping, and the degrees of freedom that it is worth."""

    time: datetime
    """Time of the tap test, or of the new baseline, that it was asked for with."""
    alone: tuple[float, float]
    """That of one direction."""
    common: tuple[float, float]
    """That of the mean of x and y."""
    series: int
    """Number of the series that it follows from."""

    @property
    def line(self) -> dict[str, Any]:
        """Line for the journal."""
        fields: dict[str, Any] = msgspec.to_builtins(self)
        return {"kind": "scatter", **fields}


def known_scatters_of(entries: Sequence[Mapping[str, Any]]) -> tuple[KnownScatter, ...]:
    """Those of a journal, oldest first."""
    return tuple(msgspec.convert(line, KnownScatter) for line in entries if line["kind"] == "scatter")
