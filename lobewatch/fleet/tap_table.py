"""The tap tests of machines as columns, straight from the bytes of their histories."""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator, Mapping, Sequence
from datetime import UTC, datetime
from itertools import chain
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

import lobewatch.fleet as plant
from acquisition.errors import format_error
from lobewatch.fleet.machine_summary import MachineSummary, read_summary, software_version
from lobewatch.machine.row_file import read_rows

TAP_NUMBER_COLUMNS = (
    "frequency_hz",
    "frequency_hz_std",
    "damping_ratio",
    "damping_ratio_std",
    "stiffness_n_per_m",
    "stiffness_n_per_m_std",
    "bearing_stiffness_n_per_m",
    "bearing_stiffness_n_per_m_std",
    "static_tip_stiffness_n_per_m",
    "modal_tip_stiffness_n_per_m",
    "temperature_c",
    "hours",
)
"""Columns of numbers: of the mode followed where it was tapped, each with its standard error; mean of the recalibrated
bearings, likewise; of the recalibrated model; of the spindle."""
TAP_CONDITION_COLUMNS = TAP_NUMBER_COLUMNS[-2:]
"""Those of them that are conditions of the tap test."""


class _RemarkCode(msgspec.Struct, gc=False):
    """The code of a remark."""

    code: str


class _TableRow(msgspec.Struct, array_like=True, gc=False):
    """The beginning of a `RowRecord` of the history, in its order; what is not needed is not looked into."""

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


class TapTable(NamedTuple):
    """The tap tests of one machine that count, oldest first."""

    folder: str
    """Name of the folder of the machine."""
    machine: str
    """Name of the machine."""
    series: Sequence[tuple[str, str]]
    """Series of tap tests that are compared with one another: tool, and direction at its tip, "x" or "y"."""
    series_numbers: Sequence[int]
    """Number of the series of each tap test, from 1 on."""
    tap_id: Sequence[str]
    """Identity of each tap test."""
    time: Sequence[float]
    """Time of each tap test (s since 1970)."""
    remarks: Sequence[str]
    """Codes of what is in doubt of each tap test, with blanks between."""
    numbers: NDArray[np.float64]
    """Numbers of each tap test as in `NUMBERS`, NaN where not known, shape (n, 12)."""


_decode_table_rows = msgspec.msgpack.Decoder(list[_TableRow]).decode
_get_series = attrgetter("tool", "direction", "series")
_get_estimates = attrgetter("frequency", "damping_ratio", "stiffness", "bearing_stiffness")
_get_modelled = attrgetter("static_tip_stiffness", "modal_tip_stiffness")


def read_tap_table(key: str, path: Path, now: datetime | None = None) -> TapTable:
    """The table of one machine; ValueError or OSError where it cannot be read. key: name of its folder."""
    now = now or datetime.now(UTC)
    summary = read_summary(path, now)
    rows = None if summary is None else _read_table_rows(path, summary)
    if summary is None or rows is None:
        summary, contents = plant.summarize_with_rows(path, now)
        rows = _decode_rows(contents)
    numbers: dict[tuple[str, str, str], int] = {}
    of_series = [numbers.setdefault(series, len(numbers) + 1) for series in map(_get_series, rows)]
    return TapTable(
        key,
        summary.name,
        [(tool, direction) for tool, direction, _ in numbers],
        of_series,
        [row.tap_id for row in rows],
        [row.time.timestamp() for row in rows],
        [_join_codes(row.remarks) for row in rows],
        _make_number_array(rows),
    )


def _join_codes(remarks: Sequence[_RemarkCode]) -> str:
    if len(remarks) < 2:
        return remarks[0].code if remarks else ""
    return " ".join(dict.fromkeys([remark.code for remark in remarks]))


def _make_number_array(rows: Sequence[_TableRow]) -> NDArray[np.float64]:
    estimates = np.fromiter(chain.from_iterable(chain.from_iterable(map(_get_estimates, rows))), np.float64)
    modelled = np.fromiter(chain.from_iterable(map(_get_modelled, rows)), np.float64)
    said = [
        [row.conditions.get(name, math.nan) if row.conditions else math.nan for row in rows]
        for name in TAP_CONDITION_COLUMNS
    ]
    return np.column_stack([estimates.reshape(-1, 8), modelled.reshape(-1, 2), np.array(said).T])


def _read_table_rows(path: Path, summary: MachineSummary) -> list[_TableRow] | None:
    """The rows of history.rows; None where it is not that of the standing."""
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
    """The rows in a place, each as it was written last; all at once, an array of msgpack."""
    rows = _decode_table_rows(struct.pack(">BI", 0xDD, len(contents)) + b"".join(contents))
    return list({row.number: row for row in rows if row.number >= 0}.values())


def read_all_tables(machines: Mapping[str, Path], damaged: dict[str, str]) -> Iterator[TapTable]:
    """The tables of all machines in order of their names; `damaged` gets those that cannot be read, with the reason."""
    for key in sorted(machines):
        try:
            yield read_tap_table(key, machines[key])
        except Exception as error:  # noqa: BLE001 - whatever is wrong with it must not cost the others their lines
            damaged[key] = format_error(error)
