"""Contents of a recorded file, the user's description of it, and the report of its import.

A format is the record of functions that read such a file.
"""

import contextlib
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from acquisition.errors import Remark, join_sentences
from acquisition.frf import Frf, FrfPoints
from acquisition.hit import Hit
from acquisition.tap_test import UNKNOWN_CONDITIONS, Circumstances, Conditions, HitDecision

Result = TypeVar("Result")
_LABEL_FIELDS = ("date", "date_pattern", "tool", "direction", "conditions", "sensor", "without_force", "hit_decisions")
_HIT_FIELDS = ("one_test", "hit_files")


@dataclass(frozen=True)
class Description:
    """User's description of a recording; empty or None: no statement. It completes what the file does not state.

    A contradiction to the file is an error, except for `columns`, which replaces its headings.
    """

    columns: tuple[str, ...] = ()
    """Columns, in their order ("time [s]", "force [N]", "-") or by name ("frf [m/N]=H1", "frf=H:2")."""
    quantity: str = ""
    """Quantity of the response: displacement, velocity or acceleration."""
    unit: str = ""
    """Unit of the response (m/s^2, g, um), or of the FRF (m/N, g/N)."""
    force_unit: str = ""
    """Unit of the force (N, lbf)."""
    skip: int | None = None
    """Number of lines to skip above the rows of a text."""
    decimal: str = ""
    """Decimal sign of the numbers of a text, "comma" or "point"; the other one separates thousands."""
    spacing: float | None = None
    """Spacing of the lines of an FRF without frequencies (Hz)."""
    start: float | None = None
    """Frequency of its first line (Hz); None: 0."""
    force: Path | None = None
    """File with the force, where the recording has only the response; its columns follow those of the response."""
    rate: float | None = None
    """Sample rate (Hz)."""
    averages: int | None = None
    """Number of hits averaged in an FRF."""
    response: int | None = None
    """Number of the response to use where there are several, from 1."""
    full_scale: tuple[float, ...] = ()
    """Full scale of each channel in its unit, where values are shares of it."""
    sensitivity: tuple[str, ...] = ()
    """Sensitivity of each channel in volts: "2.25 mV/N", "10.2 mV/g"."""
    without_force: bool = False
    """True if no force was measured, so that only a response is needed."""
    one_test: bool = False
    """True if all groups, numbered channels and rows of arrays of the file are hits of one tap test."""
    hit_files: tuple[Path, ...] = ()
    """Files with further hits of the same tap test, which implies `one_test`."""
    axes: tuple[str, ...] = ()
    """Axes of the arrays in the file: hits, channels and samples in their order."""
    sensor: str = "accelerometer"
    """Kind of sensor of a recorded cut: accelerometer or microphone."""
    tacho: str = ""
    """Name or number of the column of the spindle speed: the speed where its unit is rpm or Hz, else pulses."""
    pulses: int | None = None
    """Pulses of the tachometer per turn; None: 1."""
    date: datetime | None = None
    """Time of recording; local time where it has no zone."""
    date_pattern: str = ""
    """Pattern of the date in the file's name, as for strptime ("%Y%m%d"); with "/" in its path."""
    tool: str = ""
    """Name of the tool in the spindle."""
    direction: str = ""
    """Direction at the tool tip, x or y."""
    conditions: Conditions = UNKNOWN_CONDITIONS
    """Conditions of the test."""
    hit_decisions: tuple[HitDecision, ...] = ()
    """Decisions of a person on its hits."""

    def list_signal_options(self) -> list[str]:
        """List the given fields that state something about the signals of the file."""
        names = [option.name for option in fields(self) if option.name not in (*_LABEL_FIELDS, *_HIT_FIELDS)]
        return [f"Description.{name}" for name in names if getattr(self, name) not in ("", (), None)]


Origin = Literal["file", "option", "default"]


@dataclass(frozen=True)
class Fact:
    """Known fact of a recording."""

    name: str
    """Name of the fact: "sample rate", "unit", ..."""
    value: str
    """Value, as text for people."""
    origin: Origin
    """Origin: the file, an option of the user, or a default."""


class UnresolvedError(Exception):
    """Raised if a recording cannot be resolved; its report has the missing facts and the faults."""


@dataclass
class ImportReport:
    """Facts, gaps and faults of a recording, collected while its contents are resolved.

    The methods that add a gap or a fault return an UnresolvedError, to raise if the rest depends on it.
    """

    description: Description
    """Description that a user gives of the recording."""
    facts: list[Fact] = field(default_factory=list)
    """Known facts."""
    missing: list[str] = field(default_factory=list)
    """Facts that the file does not state, each with the field of the description that states it."""
    faults: list[str] = field(default_factory=list)
    """Faults that prevent the import."""
    remarks: list[Remark] = field(default_factory=list)
    """Remarks on hits that are left out."""
    units: list[str] = field(default_factory=list)
    """Units of the force and the response of its hits, as stated."""

    def add_fact(self, name: str, value: str, origin: Origin = "file") -> None:
        """Add a known fact."""
        self.facts.append(Fact(name, value, origin))

    def add_missing(self, fact: str, field_name: str, example: str = "") -> UnresolvedError:
        """Add a fact that is missing, and the field of the description that states it, with an example."""
        example = f", for example{example}" if example else ""
        self.missing.append(f"{fact} (give Description.{field_name}{example})")
        return UnresolvedError()

    def add_fault(self, fault: str, cure: str = "") -> UnresolvedError:
        """Add a fault of the file and its remedy."""
        self.faults.append(join_sentences(fault, cure))
        return UnresolvedError()

    def reject(self, field_name: str, value: object, fault: str, cure: str = "") -> UnresolvedError:
        """Add the fault of a field of the description and its value; None leaves the value out."""
        return self.add_fault(f"{_format_field(field_name, value)}: {fault}", cure)

    def reject_useless(self, field_name: str, value: object, reason: str) -> UnresolvedError:
        """Add the fault of a field of the description that must be omitted; None leaves the value out."""
        return self.add_fault(f"Omit {_format_field(field_name, value)}: {reason}")

    def attempt(self, resolve: Callable[..., Result], *arguments: object) -> Result | None:
        """Return the result of a function of these arguments and this report; None if it cannot be resolved."""
        try:
            return resolve(*arguments, self)
        except UnresolvedError:
            return None

    def merge(self, other: "ImportReport") -> None:
        """Add all entries of another report."""
        self.facts += other.facts
        self.missing += other.missing
        self.faults += other.faults

    def add_contradiction(self, field_name: str, given: object, in_file: object) -> UnresolvedError:
        """Add the fault of a field that differs from the file."""
        return self.reject_useless(field_name, given, f"the file states {in_file}")

    def add_flaws(self, used: Sequence["Signal"], first: int = 0) -> None:
        """Add a fault for each column with a flaw from this index on."""
        for column in used:
            if flaw := next((flaw for i, flaw in column.flaws.items() if first <= i < _count_values(column)), ""):
                cure = f"Correct the file, or omit {column.name} from Description.columns"
                self.add_fault(f"column {column.name} {flaw}", cure)

    @property
    def is_clean(self) -> bool:
        """True if nothing is missing or wrong."""
        return not self.missing and not self.faults

    def require_clean(self) -> None:
        """Raise UnresolvedError where something is missing or wrong."""
        if not self.is_clean:
            raise UnresolvedError

    def format_problems(self) -> str:
        """Return all faults and missing facts; empty if there are none."""
        missing = f"{'Missing' if self.faults else 'missing'} {' and '.join(self.missing)}" if self.missing else ""
        return join_sentences(*self.faults, missing)


def _format_field(name: str, value: object) -> str:
    return f"Description.{name}{'' if value is None else f' {value}'}"


FrfRole = Literal["frf", "real", "imag", "magnitude", "phase", "coherence"]
"""Meaning of a signal that belongs to an FRF."""
Role = Literal["time", "frequency", "force", "response", "speed", "tacho", FrfRole, "ignored", ""]
"""Meaning of a signal; empty if unknown."""


@dataclass(frozen=True, eq=False)
class Signal:
    """Column, channel or function of a file."""

    name: str
    """Name, as in the file."""
    values: NDArray[Any]
    """Values as in the file, real or complex, shape (n,)."""
    role: Role = ""
    """Role of the signal; empty if the file does not state it."""
    unit: str = ""
    """Unit as in the file, empty if unknown; dB of a magnitude, deg or rad of a phase."""
    quantity: str = ""
    """Quantity (displacement, velocity, acceleration, force) where the file states it apart from the unit."""
    direction: str = ""
    """Direction: x, y, z or -x, -y, -z; empty if unknown."""
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
    array: NDArray[Any] | None = None
    """Array of two or more axes that it is a column of."""
    points: FrfPoints | None = None
    """Points of response and hit of an FRF, where the file numbers them."""


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
    """Direction at the tool tip; empty if unknown."""
    tool: str = ""
    """Name of the tool in the spindle; empty if unknown."""
    machines: tuple[str, ...] = ()
    """Names of the tested machines, each once, where the file states them."""
    window: str = ""
    """Window over the response, as the file states it; empty if unknown."""
    notes: tuple[str, ...] = ()
    """Notes for people."""
    groups: tuple[str, ...] = ()
    """Names of its groups, each once, which may be machines."""


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

    If there are several axes, only the longest counts, because the others may belong to other columns.
    """
    by_size = sorted([*used, *sorted(axes, key=_count_values)[-1:]], key=_count_values)
    if not by_size or not all(_is_in_same_table(column, by_size[0]) for column in by_size):
        return list(used), list(axes)
    n, longest = _count_values(by_size[0]), _count_values(by_size[-1])
    if longest > n:
        report.add_fact("rows", f"{n} of {longest}, because {by_size[0].name} has no more rows", "default")
    cut = [[replace(column, values=column.values[:n]) for column in columns] for columns in (used, axes)]
    return cut[0], cut[1]


def has_same_axis(one: Signal, other: Signal) -> bool:
    """Return whether two signals of a record have a common axis: in one table, or with as many values."""
    return one.record == other.record and (_is_in_same_table(one, other) or one.values.shape == other.values.shape)


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
    """Parse a time by the first pattern that fits, local where it has no zone; None if it cannot be read."""
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
    shape = "of unknown form" if math.isnan(time_constant or 0.0) else f"exponential {time_constant!r} s"
    return "none" if time_constant is None else shape


MAX_ARRAY_COLUMNS = 1024
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
            yield replace(_make_array_signal(f"{name}:{i}", column), array=value)


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
    """Function that reads when, where and by whom a file was recorded; None if it does not state that."""
    read_frf: Callable[[Path], Frf] | None = None
    """Function that reads the FRF of a file that also has hits; None if it is estimated from them."""
    read_from: Callable[[Path, int, str], Contents] | None = None
    """Function that reads a text after skipped lines, with a decimal sign (empty: unknown); None for other files."""
