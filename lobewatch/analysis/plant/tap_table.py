"""One line a tap test of all machines, straight from the bytes of their histories."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from lobewatch.analysis.plant.standing_file import read_standing, software
from lobewatch.analysis.plant.summary import Summary
from lobewatch.machine.archive.rows import read_rows


class _Code(msgspec.Struct, gc=False):
    code: str


class _Stored(msgspec.Struct, array_like=True, gc=False):
    """The beginning of `columns.stored_row.Stored`, in its order; what is not needed is not looked into."""

    number: int
    tap_id: str
    time: datetime
    tool: str
    direction: str
    baseline: str
    series: str
    conditions: dict[str, Any]
    frequency: tuple[float, float]
    damping_ratio: tuple[float, float]
    stiffness: tuple[float, float]
    phase_deg: msgspec.Raw
    bearing_stiffness: tuple[float, float]
    static_tip_stiffness: float
    modal_tip_stiffness: float
    modes: msgspec.Raw
    x: msgspec.Raw
    y: msgspec.Raw
    remarks: tuple[_Code, ...]


class TapLine(NamedTuple):
    """One tap test; numbers that are not known are NaN, texts empty."""

    folder: str
    """Name of the folder of its machine."""
    machine: str
    """Name of its machine."""
    tap_id: str
    """Its identity."""
    time: float
    """When it was taken (s since 1970)."""
    tool: str
    """What was in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    series: int
    """Which of its machine it is compared with, from 1 on."""
    frequency_hz: float
    """Of the mode followed."""
    frequency_hz_std: float
    """Its standard error."""
    damping_ratio: float
    """Of the mode followed."""
    damping_ratio_std: float
    """Its standard error."""
    stiffness_n_per_m: float
    """Of the mode followed, where it was tapped."""
    stiffness_n_per_m_std: float
    """Its standard error."""
    bearing_stiffness_n_per_m: float
    """Mean of the recalibrated bearings."""
    bearing_stiffness_n_per_m_std: float
    """Its standard error."""
    static_tip_stiffness_n_per_m: float
    """Of the recalibrated model."""
    modal_tip_stiffness_n_per_m: float
    """Of the recalibrated model."""
    temperature_c: float
    """Of the spindle."""
    remarks: str
    """Codes of what is in doubt, with blanks between."""


_decode = msgspec.msgpack.Decoder(_Stored).decode


def tap_lines(key: str, path: Path, now: datetime | None = None) -> list[TapLine]:
    """Those of one machine that count, oldest first; ValueError or OSError where it cannot be read."""
    now = now or datetime.now(UTC)
    summary = read_standing(path, now)
    packed = None if summary is None else _stored(path, summary)
    if summary is None or packed is None:
        summary, packed = _worked_out(path, now)
    numbers: dict[tuple[str, str], int] = {}
    name, found = summary.name, list[TapLine]()
    for one in packed:
        series = numbers.setdefault((one.series, one.direction), len(numbers) + 1)
        temperature = one.conditions.get("temperature_c", math.nan) if one.conditions else math.nan
        remarks = " ".join(dict.fromkeys([remark.code for remark in one.remarks])) if one.remarks else ""
        values = (
            *(key, name, one.tap_id, one.time.timestamp(), one.tool, one.direction, series),
            *one.frequency,
            *one.damping_ratio,
            *one.stiffness,
            *one.bearing_stiffness,
            *(one.static_tip_stiffness, one.modal_tip_stiffness, temperature, remarks),
        )
        found.append(tuple.__new__(TapLine, values))  # a million of them: half the time of TapLine(*values)
    return found


def _stored(path: Path, summary: Summary) -> list[_Stored] | None:
    """From history.rows; None where it is not that of the standing."""
    try:
        head, *contents = read_rows(path / "history.rows").rows
        found: list[_Stored] = []
        for content in contents:
            one = _decode(content)
            if one.number >= 0:
                found[one.number : one.number + 1] = [one]
    except (OSError, ValueError):
        return None
    is_own = head.decode().endswith(f" lobewatch {software()}") and len(found) == summary.tap_tests
    return found if is_own else None


def _worked_out(path: Path, now: datetime) -> tuple[Summary, list[_Stored]]:
    from lobewatch.analysis.columns.stored_row import packed
    from lobewatch.analysis.logbook import Logbook
    from lobewatch.analysis.plant.summarise import summarise

    logbook = Logbook.open(path)
    summary, hashes = summarise(logbook, now), logbook.machine.program_hashes
    return summary, [_decode(packed(number, row, hashes)) for number, row in enumerate(logbook.history.rows)]


def all_lines(machines: Mapping[str, Path], damaged: dict[str, str]) -> Iterator[TapLine]:
    """Of all machines in order of their names; those that cannot be read are added to `damaged`, with the reason."""
    for key in sorted(machines):
        try:
            yield from tap_lines(key, machines[key])
        except (ValueError, OSError) as error:
            damaged[key] = str(error)
