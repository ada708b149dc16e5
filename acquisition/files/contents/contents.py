"""Signals of a recorded file, and the record of functions that reads a format."""

import contextlib
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from acquisition.files.contents.description import ImportReport
from acquisition.frf import Frf
from acquisition.hit import Hit
from acquisition.tap_test import Circumstances

FrfRole = Literal["frf", "real", "imag", "magnitude", "phase", "coherence"]
"""Meaning of a signal that belongs to an FRF."""
Role = Literal["time", "frequency", "force", "response", "speed", "tacho", FrfRole, "ignored", ""]
"""Meaning of a signal; empty where unknown."""


@dataclass(frozen=True, eq=False)
class Signal:
    """Column, channel or function of a file."""

    name: str
    """Name, as in the file."""
    values: NDArray[Any]
    """Values as in the file, real or complex, shape (n,)."""
    role: Role = ""
    """Role of the signal; empty where the file does not state it."""
    unit: str = ""
    """Unit as in the file, empty where unknown; dB of a magnitude, deg or rad of a phase."""
    quantity: str = ""
    """Quantity (displacement, velocity, acceleration, force) where the file states it apart from the unit."""
    direction: str = ""
    """Direction: x, y, z or -x, -y, -z; empty where unknown."""
    rate: float | None = None
    """Sample rate that the file states (Hz)."""
    record: int = 0
    """Number of the record: signals recorded together have the same."""
    per_full_scale: bool = False
    """True if the values are shares of an unknown full scale."""
    is_before_window: bool = False
    """True if it was recorded before the window that the file states."""
    n_rows: int = 0
    """Number of rows of its table, the first of them its first value; 0 where it is no column of a table."""
    flaws: Mapping[int, str] = field(default_factory=dict)
    """Fault of each value that is NaN, as "is empty in line 7", by its index."""


@dataclass(frozen=True, eq=False)
class Contents:
    """Contents of a recorded file, not interpreted."""

    signals: tuple[Signal, ...]
    """Signals in the order of the file."""
    averages: int | None = None
    """Number of hits averaged in an FRF."""
    created: datetime | None = None
    """Time of recording (timezone-aware)."""
    direction: str = ""
    """Direction at the tool tip; empty where unknown."""
    tool: str = ""
    """Name of the tool in the spindle; empty where unknown."""
    machines: tuple[str, ...] = ()
    """Names of the tested machines, each once, where the file states them."""
    window: str = ""
    """Window over the response, as the file states it; empty where unknown."""
    notes: tuple[str, ...] = ()
    """Notes for people."""


def list_distinct_names(names: Iterable[str]) -> tuple[str, ...]:
    """List names that differ in more than a number, each once: "hit 1" and "hit 2" are the same."""
    spellings: dict[str, str] = {}
    for name in names:
        spellings.setdefault(re.sub(r"[\d\s_.#-]+", "", name).lower(), name)
    return tuple(name for plain, name in spellings.items() if plain)


def cut_to_shortest(
    used: Sequence[Signal], axes: Sequence[Signal], report: ImportReport
) -> tuple[list[Signal], list[Signal]]:
    """Cut columns and their axes of one table to the shortest, and report it; leave others unchanged.

    Of several axes only the longest counts, because the others may belong to other columns.
    """
    by_size = sorted([*used, *sorted(axes, key=_count_values)[-1:]], key=_count_values)
    if not by_size or not all(_is_in_same_table(column, by_size[0]) for column in by_size):
        return list(used), list(axes)
    n, longest = _count_values(by_size[0]), _count_values(by_size[-1])
    if longest > n:
        report.add_fact("rows", f"{n} of {longest}, as {by_size[0].name} ends there", "default")
    cut = [[replace(column, values=column.values[:n]) for column in columns] for columns in (used, axes)]
    return cut[0], cut[1]


def has_same_axis(one: Signal, other: Signal) -> bool:
    """Return whether two signals of a record have a common axis: in one table, or with as many values."""
    return one.record == other.record and (_is_in_same_table(one, other) or one.values.shape == other.values.shape)


def report_flaws(used: Sequence[Signal], report: ImportReport, first: int = 0) -> None:
    """Report a fault for each column with a flaw from this index on."""
    for column in used:
        if flaw := next((flaw for place, flaw in column.flaws.items() if first <= place < _count_values(column)), ""):
            remedy = f"mend it there, or leave {column.name} out of Description.columns"
            report.add_fault(f"{column.name} {flaw}; {remedy}")


def _is_in_same_table(one: Signal, other: Signal) -> bool:
    return one.n_rows == other.n_rows != 0


def _count_values(signal: Signal) -> int:
    return signal.values.size


def append_force_signals(response: Contents, force: Contents, force_file: Path) -> Contents:
    """Append the signals of a force file; a name that both have gets the name of its file."""
    names, file = {signal.name for signal in response.signals}, force_file.name
    added = (replace(one, name=f"{one.name} of {file}") if one.name in names else one for one in force.signals)
    return replace(response, signals=(*response.signals, *added))


def parse_local_time(text: str, *patterns: str) -> datetime | None:
    """Parse a time by the first pattern that fits, local where it has no zone; None where it cannot be read."""
    for pattern in patterns:
        with contextlib.suppress(ValueError, OverflowError, OSError):
            return datetime.strptime(text, pattern).astimezone()
    return None


_NO_WINDOW = re.compile(r"\s*(none|no|off|rect\w*|uniform|boxcar|transient|force.*)?\s*", re.IGNORECASE)
_TIME_CONSTANT = re.compile(r"([\d.]+(?:[eE][+-]?\d+)?)\s*(m?)s\b")


def parse_time_constant(window: str) -> float | None:
    """Parse the time constant of "exponential 0.05 s" (s); None without a window, NaN where it is not stated."""
    if _NO_WINDOW.fullmatch(window):
        return None
    constant = _TIME_CONSTANT.search(window)
    if constant is None or "exp" not in window.lower():
        return math.nan
    return float(constant[1]) * (1e-3 if constant[2] else 1.0)


def format_window(time_constant: float | None) -> str:
    """Format a time constant as `parse_time_constant` reads it."""
    if time_constant is None:
        return "none"
    return "of unknown form" if math.isnan(time_constant) else f"exponential {time_constant!r} s"


MAX_ARRAY_COLUMNS = 64
"""Largest number of columns of an array that become signals."""
MIN_FRF_LINES = 8
"""Smallest number of complex values of an FRF; fewer are poles."""


def list_array_signals(variables: Mapping[str, Any], glue: str = ".", prefix: str = "") -> Iterator[Signal]:
    """Yield every vector of numbers, and the columns of an array along its longest dimension as name:1, name:2.

    Complex vectors are FRFs. glue: separator between the names of groups.
    """
    for name, value in variables.items():
        if isinstance(value, Mapping):
            yield from list_array_signals(value, glue, f"{prefix}{name}{glue}")
        elif isinstance(value, list):
            yield from list_array_signals({str(i): part for i, part in enumerate(value, 1)}, glue, f"{prefix}{name}:")
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiuc":
            yield from _split_array(f"{prefix}{name}", value)


def _split_array(name: str, value: NDArray[Any]) -> Iterator[Signal]:
    if value.ndim == 1 and value.size > 1:
        yield _make_array_signal(name, value)
    elif value.ndim > 1 and value.size > 1:
        columns = np.moveaxis(value, int(np.argmax(value.shape)), -1).reshape(-1, max(value.shape))
        for i, column in enumerate(columns[:MAX_ARRAY_COLUMNS], 1):
            yield _make_array_signal(f"{name}:{i}", column)


def _make_array_signal(name: str, column: NDArray[Any]) -> Signal:
    """Make a signal, real where no value has an imaginary part.

    MATLAB has one type for all columns of a matrix.
    """
    if not np.iscomplexobj(column) or not np.any(column.imag):
        return Signal(name, column.real)
    return Signal(name, column, "frf" if column.size >= MIN_FRF_LINES else "")


@dataclass(frozen=True)
class Format:
    """Kind of recorded file, with the functions that read it.

    The functions raise DataError with path and place for a damaged file.
    """

    name: str
    """Short name in lower case, unique among all formats."""
    title: str
    """Name for people."""
    extensions: tuple[str, ...]
    """Usual extensions of such files, with the dot: for messages, and for the search of folders."""
    matches: Callable[[bytes, Path], bool]
    """Function that recognizes a file by its first 4096 bytes (at least one) and, where needed, all of it."""
    read: Callable[[Path], Contents | list[Hit] | Frf]
    """Function that reads a file: its contents, or hits in SI units, at least one, or an FRF, where nothing is open."""
    read_circumstances: Callable[[Path], Circumstances | None] = lambda _path: None
    """Function that reads when, where and by whom a file was recorded; None where it does not state that."""
    read_frf: Callable[[Path], Frf] | None = None
    """Function that reads the FRF of a file that also has hits; None where it is estimated from them."""
    read_from: Callable[[Path, int, str], Contents] | None = None
    """Function that reads a text after some skipped lines, with a decimal sign (empty: unknown); None for other files.
    """
