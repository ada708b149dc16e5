"""Signals of a recorded file, and the record of functions that reads a format."""

from __future__ import annotations

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


def list_distinct_names(names: Iterable[str]) -> tuple[str, ...]:
    """Names that differ in more than a number, each once: "hit 1" and "hit 2" are one; empty ones are none."""
    spellings: dict[str, str] = {}
    for name in names:
        spellings.setdefault(re.sub(r"[\d\s_.#-]+", "", name).lower(), name)
    return tuple(name for plain, name in spellings.items() if plain)


def cut_to_shortest(
    used: Sequence[Signal], axes: Sequence[Signal], report: ImportReport
) -> tuple[list[Signal], list[Signal]]:
    """Columns and their axes cut to where the first of them ends, which the report tells; others as they are.

    Of several axes only the longest counts: the others may be those of other columns.
    """
    by_size = sorted([*used, *sorted(axes, key=_count_values)[-1:]], key=_count_values)
    if not by_size or not all(_is_in_same_table(column, by_size[0]) for column in by_size):
        return list(used), list(axes)
    shortest, n = by_size[0], _count_values(by_size[0])
    if _count_values(by_size[-1]) > n:
        report.add_fact("rows", f"{n} of {_count_values(by_size[-1])}, as {shortest.name} ends there", "default")
    cut = [[replace(column, values=column.values[:n]) for column in columns] for columns in (used, axes)]
    return cut[0], cut[1]


def has_same_axis(one: Signal, other: Signal) -> bool:
    """Whether two signals of a record have their values at the same places: in one table, or as many."""
    return one.record == other.record and (_is_in_same_table(one, other) or one.values.shape == other.values.shape)


def report_flaws(used: Sequence[Signal], report: ImportReport, first: int = 0) -> None:
    """A fault for each column with a flaw from this place on."""
    for column in used:
        flaw = next((flaw for place, flaw in column.flaws.items() if first <= place < _count_values(column)), "")
        if flaw:
            remedy = f"mend it there, or leave {column.name} out of Description.columns"
            report.faults.append(f"{column.name} {flaw}; {remedy}")


def _is_in_same_table(one: Signal, other: Signal) -> bool:
    return one.n_rows == other.n_rows != 0


def _count_values(signal: Signal) -> int:
    return signal.values.size


def append_force_signals(response: Contents, force: Contents, force_file: Path) -> Contents:
    """The signals of both, those of the force behind; where both have a name it says which file it is of."""
    names = {signal.name for signal in response.signals}
    added = [_rename_if_taken(signal, names, force_file.name) for signal in force.signals]
    return replace(response, signals=(*response.signals, *added))


def _rename_if_taken(signal: Signal, names: set[str], file: str) -> Signal:
    return replace(signal, name=f"{signal.name} of {file}") if signal.name in names else signal


_NO_WINDOW = re.compile(r"\s*(none|no|off|rect\w*|uniform|boxcar|transient|force.*)?\s*", re.IGNORECASE)
_TIME_CONSTANT = re.compile(r"([\d.]+(?:[eE][+-]?\d+)?)\s*(m?)s\b")


def parse_time_constant(window: str) -> float | None:
    """Of "exponential 0.05 s" (s); None where there is no window, NaN where it is not told how it falls."""
    if _NO_WINDOW.fullmatch(window):
        return None
    constant = _TIME_CONSTANT.search(window)
    if constant is None or "exp" not in window.lower():
        return math.nan
    return float(constant[1]) * (1e-3 if constant[2] else 1.0)


def format_window(time_constant: float | None) -> str:
    """The same as text."""
    if time_constant is None:
        return "none"
    return "of unknown form" if math.isnan(time_constant) else f"exponential {time_constant!r} s"


MAX_ARRAY_COLUMNS = 64
"""Columns of an array that are told one by one."""
MIN_FRF_LINES = 8
"""Complex numbers that may be an FRF; fewer are poles."""


def list_array_signals(variables: Mapping[str, Any], glue: str = ".", prefix: str = "") -> Iterator[Signal]:
    """Every row of two or more numbers; those of an array of several dimensions, along its longest, as name:1, name:2.

    glue: what stands between the names of groups. Complex ones are FRFs.
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
        yield from (
            _make_array_signal(f"{name}:{i}", column) for i, column in enumerate(columns[:MAX_ARRAY_COLUMNS], 1)
        )


def _make_array_signal(name: str, column: NDArray[Any]) -> Signal:
    """Numbers that have no imaginary part at all are real: MATLAB has one type for all columns of a matrix."""
    if not np.iscomplexobj(column) or not np.any(column.imag):
        return Signal(name, column.real)
    return Signal(name, column, "frf" if column.size >= MIN_FRF_LINES else "")


def _read_no_circumstances(_path: Path) -> None:
    """Of when, where and by whom it was recorded."""


@dataclass(frozen=True)
class Format:
    """One kind of recorded file. Its functions raise DataError, with the path and the place, for a damaged one."""

    name: str
    """Short name, in lower case, of its own among all formats."""
    title: str
    """Name for people."""
    extensions: tuple[str, ...]
    """Endings that names of such files mostly have, with the dot: for messages, and for what of a folder is read at
    all."""
    matches: Callable[[bytes, Path], bool]
    """Whether a file is of this kind, from its first 4096 bytes (it has at least one) and, where need be, all of it."""
    read: Callable[[Path], Contents | list[Hit] | Frf]
    """Function that reads it: its contents, or hits in SI units, at least one, or an FRF, where the format leaves
    nothing open."""
    read_circumstances: Callable[[Path], Circumstances | None] = _read_no_circumstances
    """Function that reads when, where and by whom it was recorded, beside its Contents; None where it says nothing."""
    read_frf: Callable[[Path], Frf] | None = None
    """Function that reads the FRF it holds beside its hits; None where that is to be estimated from them."""
    read_from: Callable[[Path, int, str], Contents] | None = None
    """Function that reads it behind some first lines, with a decimal sign (empty where nobody says it); None where it
    is not a text of lines."""
