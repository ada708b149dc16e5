"""Read the tap tests of machines as columns, straight from the bytes of their histories."""

import math
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from itertools import chain
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

import lobewatch.fleet as fleet
from acquisition.errors import format_error
from lobewatch.fleet.machine_summary import MachineSummary, read_summary, software_version
from lobewatch.machine.row_file import read_rows

TAP_CONDITION_COLUMNS = ("temperature_c", "hours")
"""Columns of conditions of the tap test."""
_ESTIMATE_COLUMNS = ("frequency_hz", "damping_ratio", "stiffness_n_per_m", "bearing_stiffness_n_per_m")
TAP_NUMBER_COLUMNS = (
    *(f"{name}{suffix}" for name in _ESTIMATE_COLUMNS for suffix in ("", "_std")),
    *("static_tip_stiffness_n_per_m", "modal_tip_stiffness_n_per_m"),
    *TAP_CONDITION_COLUMNS,
)
"""Columns of numbers: followed mode at the tapped point and mean calibrated bearing stiffness, each with its standard
error; tip stiffness of the calibrated model; conditions of the tap test."""


class _RemarkCode(msgspec.Struct, gc=False):
    code: str


class _TableRow(msgspec.Struct, array_like=True, gc=False):
    """First fields of a `RowRecord`, in its order. Raw fields are not decoded."""

    number: int
    tap_id: str
    time: datetime
    tool: str
    direction: str
    baseline: msgspec.Raw
    series: str
    conditions: dict[str, Any]
    frequency: list[float]
    damping_ratio: list[float]
    stiffness: list[float]
    phase_deg: msgspec.Raw
    bearing_stiffness: list[float]
    static_tip_stiffness: float
    modal_tip_stiffness: float
    modes: msgspec.Raw
    x: msgspec.Raw
    y: msgspec.Raw
    remarks: list[_RemarkCode]


class TapTestTable(NamedTuple):
    """Tap tests of one machine as columns, oldest first."""

    folder: str
    """Name of the machine folder."""
    machine: str
    """Name of the machine."""
    series: Sequence[tuple[str, str]]
    """Tool and direction ("x" or "y") of each series of comparable tap tests."""
    series_numbers: Sequence[int]
    """Number of the series of each tap test, from 1."""
    tap_id: Sequence[str]
    """Identity of each tap test."""
    time: Sequence[float]
    """Time of each tap test (s since 1970)."""
    remarks: Sequence[str]
    """Codes of the remarks on each tap test, separated by blanks."""
    numbers: NDArray[np.float64]
    """Values of `TAP_NUMBER_COLUMNS`, NaN if unknown, shape (n, 12)."""


_decode_table_rows = msgspec.msgpack.Decoder(list[_TableRow]).decode
_get_series = attrgetter("tool", "direction", "series")
_get_estimates = attrgetter("frequency", "damping_ratio", "stiffness", "bearing_stiffness")
_get_modelled = attrgetter("static_tip_stiffness", "modal_tip_stiffness")


def read_tap_table(
    key: str, path: Path, now: datetime | None = None, render_text: Callable[[str], str] = str
) -> TapTestTable:
    """Read the tap tests of one machine folder named `key`. ValueError or OSError if it cannot be read.

    `render_text` replaces names of the library in the texts of a new summary.
    """
    now = now or datetime.now(UTC)
    summary = read_summary(path, now)
    rows = None if summary is None else _read_table_rows(path, summary)
    if summary is None or rows is None:
        summary, contents = fleet.summarize_with_rows(path, now, render_text)
        rows = _decode_rows(contents)
    numbers: dict[tuple[str, str, str], int] = {}
    series_numbers = [numbers.setdefault(series, len(numbers) + 1) for series in map(_get_series, rows)]
    series = [(tool, direction) for tool, direction, _ in numbers]
    tap_ids, times = [row.tap_id for row in rows], [row.time.timestamp() for row in rows]
    codes, values = [_join_codes(row.remarks) for row in rows], _make_number_array(rows)
    return TapTestTable(key, summary.name, series, series_numbers, tap_ids, times, codes, values)


def _join_codes(remarks: Sequence[_RemarkCode]) -> str:
    if len(remarks) < 2:
        return remarks[0].code if remarks else ""
    return " ".join(dict.fromkeys([remark.code for remark in remarks]))


def _make_number_array(rows: Sequence[_TableRow]) -> NDArray[np.float64]:
    estimates = np.fromiter(chain.from_iterable(chain.from_iterable(map(_get_estimates, rows))), np.float64)
    modelled = np.fromiter(chain.from_iterable(map(_get_modelled, rows)), np.float64)
    known = [row.conditions or {} for row in rows]
    conditions = [[fields.get(name, math.nan) for fields in known] for name in TAP_CONDITION_COLUMNS]
    return np.column_stack([estimates.reshape(-1, 8), modelled.reshape(-1, 2), np.array(conditions).T])


def _read_table_rows(path: Path, summary: MachineSummary) -> list[_TableRow] | None:
    """Read history.rows. None if it does not belong to the summary."""
    if not summary.tap_tests:
        return []
    try:
        head, *contents = read_rows(path / "history.rows").rows
        rows = _decode_rows(contents)
    except (OSError, ValueError):
        return None
    is_ours = head.decode().endswith(f" lobewatch {software_version()}") and len(rows) == summary.tap_tests
    return rows if is_ours else None


def _decode_rows(contents: Sequence[bytes]) -> list[_TableRow]:
    """Decode rows at once, as an array of msgpack. The last one counts for each place."""
    rows = _decode_table_rows(struct.pack(">BI", 0xDD, len(contents)) + b"".join(contents))
    return list({row.number: row for row in rows if row.number >= 0}.values())


def read_all_tables(
    machines: Mapping[str, Path], damaged: dict[str, str], render_text: Callable[[str], str] = str
) -> Iterator[TapTestTable]:
    """Read the tables of all machines by name. `damaged` gets the reason for each unreadable machine."""
    for key in sorted(machines):
        try:
            yield read_tap_table(key, machines[key], render_text=render_text)
        except Exception as error:  # noqa: BLE001 - an unreadable machine must not hide the others
            damaged[key] = format_error(error)
