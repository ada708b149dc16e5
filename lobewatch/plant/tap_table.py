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

from lobewatch.machine.rows import read_rows
from lobewatch.plant.standing_file import read_standing, software
from lobewatch.plant.summary import Summary

NUMBERS = (
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
)
"""Of the mode followed, where it was tapped, each with its standard error; mean of the recalibrated bearings, likewise;
of the recalibrated model; of the spindle."""


class _Code(msgspec.Struct, gc=False):
    code: str


class _Stored(msgspec.Struct, array_like=True, gc=False):
    """The beginning of `columns.stored_row.Stored`, in its order; what is not needed is not looked into."""

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
    remarks: list[_Code]


class TapTable(NamedTuple):
    """The tap tests of one machine that count, oldest first."""

    folder: str
    """Name of the folder of the machine."""
    machine: str
    """Name of the machine."""
    series: Sequence[tuple[str, str]]
    """What is compared with one another: tool, and direction at its tip, "x" or "y"."""
    of_series: Sequence[int]
    """Of each tap test, from 1 on."""
    tap_id: Sequence[str]
    """Of each tap test."""
    time: Sequence[float]
    """Of each tap test (s since 1970)."""
    remarks: Sequence[str]
    """Of each tap test: codes of what is in doubt, with blanks between."""
    numbers: NDArray[np.float64]
    """Of each tap test those of `NUMBERS`, NaN where not known, shape (n, 11)."""


_decode = msgspec.msgpack.Decoder(list[_Stored]).decode
_series = attrgetter("tool", "direction", "series")
_estimates = attrgetter("frequency", "damping_ratio", "stiffness", "bearing_stiffness")
_modelled = attrgetter("static_tip_stiffness", "modal_tip_stiffness")


def tap_table(key: str, path: Path, now: datetime | None = None) -> TapTable:
    """That of one machine; ValueError or OSError where it cannot be read. key: name of its folder."""
    now = now or datetime.now(UTC)
    summary = read_standing(path, now)
    rows = None if summary is None else _stored(path, summary)
    if summary is None or rows is None:
        summary, rows = _worked_out(path, now)
    found: dict[tuple[str, str, str], int] = {}
    of_series = [found.setdefault(one, len(found) + 1) for one in map(_series, rows)]
    return TapTable(
        key,
        summary.name,
        [(tool, direction) for tool, direction, _ in found],
        of_series,
        [one.tap_id for one in rows],
        [one.time.timestamp() for one in rows],
        [_codes(one.remarks) for one in rows],
        _numbers(rows),
    )


def _codes(remarks: Sequence[_Code]) -> str:
    if len(remarks) < 2:
        return remarks[0].code if remarks else ""
    return " ".join(dict.fromkeys([one.code for one in remarks]))


def _numbers(rows: Sequence[_Stored]) -> NDArray[np.float64]:
    estimates = np.fromiter(chain.from_iterable(chain.from_iterable(map(_estimates, rows))), np.float64)
    modelled = np.fromiter(chain.from_iterable(map(_modelled, rows)), np.float64)
    warmth = [one.conditions.get("temperature_c", math.nan) if one.conditions else math.nan for one in rows]
    return np.column_stack([estimates.reshape(-1, 8), modelled.reshape(-1, 2), np.array(warmth)])


def _stored(path: Path, summary: Summary) -> list[_Stored] | None:
    """From history.rows; None where it is not that of the standing."""
    if not summary.tap_tests:
        return []
    try:
        head, *contents = read_rows(path / "history.rows").rows
        found = _decoded(contents)
    except (OSError, ValueError):
        return None
    is_own = head.decode().endswith(f" lobewatch {software()}") and len(found) == summary.tap_tests
    return found if is_own else None


def _decoded(contents: Sequence[bytes]) -> list[_Stored]:
    """Those in a place, each as it was written last; all at once, an array of msgpack."""
    rows = _decode(struct.pack(">BI", 0xDD, len(contents)) + b"".join(contents))
    return list({one.number: one for one in rows if one.number >= 0}.values())


def _worked_out(path: Path, now: datetime) -> tuple[Summary, list[_Stored]]:
    from lobewatch.history.row_bytes import encode_row
    from lobewatch.logbook.logbook import Logbook
    from lobewatch.plant.summarise import summarise

    logbook = Logbook.open(path)
    summary, hashes = summarise(logbook, now), logbook.machine.program_hashes
    return summary, _decoded([encode_row(number, row, hashes) for number, row in enumerate(logbook.history.rows)])


def all_tables(machines: Mapping[str, Path], damaged: dict[str, str]) -> Iterator[TapTable]:
    """Of all machines in order of their names; those that cannot be read are added to `damaged`, with the reason."""
    for key in sorted(machines):
        try:
            yield tap_table(key, machines[key])
        except (ValueError, OSError) as error:
            damaged[key] = str(error)
