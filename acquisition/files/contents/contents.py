"""What stands in a recorded file, before it is decided what it means."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Literal

from numpy.typing import NDArray

Role = Literal[
    "time",
    "frequency",
    "force",
    "response",
    "speed",
    "tacho",
    "frf",
    "real",
    "imag",
    "magnitude",
    "phase",
    "coherence",
    "ignored",
    "",
]


@dataclass(frozen=True, eq=False)
class Signal:
    """One column, channel or function of a file."""

    name: str
    """Name, as in the file."""
    values: NDArray[Any]
    """Values as in the file, real or complex, shape (n,)."""
    role: Role = ""
    """Role of the signal, where the file says so; empty where it does not."""
    unit: str = ""
    """Unit as in the file; empty where it does not say. dB of a magnitude; deg or rad of a phase."""
    quantity: str = ""
    """Quantity (displacement, velocity, acceleration, force), where the file says so beside the unit."""
    direction: str = ""
    """Direction: x, y, z or -x, -y, -z; empty where the file does not say."""
    rate: float | None = None
    """Samples a second that the file names (Hz)."""
    record: int = 0
    """Number of the record: signals that were recorded together have the same."""
    per_full_scale: bool = False
    """Whether the values are shares of a full scale that the file does not name."""
    is_before_window: bool = False
    """Whether it was recorded before the window that the file names."""
    n_rows: int = 0
    """Number of rows of the table it is a column of, the first of them its first value; a column of fewer values ends
    before others do. 0 where it is no column of a table."""
    flaws: Mapping[int, str] = field(default_factory=dict)
    """What is wrong with a value that is NaN, as "is empty in line 7", by its place."""


@dataclass(frozen=True, eq=False)
class Contents:
    """All of a file."""

    signals: tuple[Signal, ...]
    """Signals in the order of the file."""
    averages: int | None = None
    """Hits that an FRF was averaged from."""
    created: datetime | None = None
    """Time of recording (timezone-aware)."""
    direction: str = ""
    """Direction at the tool tip; empty where the file does not say."""
    tool: str = ""
    """Name of the tool in the spindle; empty where the file does not say."""
    machines: tuple[str, ...] = ()
    """Names of what was tapped, each once, where the file says so."""
    window: str = ""
    """Window over the response, as the file names it; empty where it does not."""
    notes: tuple[str, ...] = ()
    """Notes on what else should be known of it."""


def distinct(names: Iterable[str]) -> tuple[str, ...]:
    """Names that differ in more than a number, each once: "hit 1" and "hit 2" are one; empty ones are none."""
    spellings: dict[str, str] = {}
    for name in names:
        spellings.setdefault(re.sub(r"[\d\s_.#-]+", "", name).lower(), name)
    return tuple(name for plain, name in spellings.items() if plain)
