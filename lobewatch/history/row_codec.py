"""Encode and decode a history row."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Any

import msgspec

from acquisition import UNKNOWN_CONDITIONS, Conditions, Remark
from lobewatch.history.history import HistoryRow, ModeValues
from lobewatch.measurement.estimate import Estimate
from lobewatch.verdicts.verdict import StoredVerdict


class RowRecord(msgspec.Struct, array_like=True, gc=False):
    """A row with its place, times as text, which keep their zone, and each ruling with the hash of its program."""

    number: int
    tap_id: str
    time: str
    tool: str
    direction: str
    baseline: str
    series: str
    conditions: dict[str, Any]
    frequency: Estimate
    damping_ratio: Estimate
    stiffness: Estimate
    phase_deg: Estimate
    bearing_stiffness: Estimate
    static_tip_stiffness: float
    modal_tip_stiffness: float
    modes: tuple[ModeValues, ...]
    x: tuple[ModeValues, ...]
    y: tuple[ModeValues, ...]
    remarks: tuple[Remark, ...]
    verdicts: dict[str, tuple[str, StoredVerdict]]
    software: str = ""
    operator: str = ""


CONVERTED_FIELDS = ("number", "time", "baseline", "conditions", "verdicts", "software")
"""Fields that a record has otherwise than a row."""
SHARED_FIELDS = tuple(name for name in RowRecord.__struct_fields__ if name not in CONVERTED_FIELDS)
"""Fields that both have alike."""
_encode_record, _decode_record = msgspec.msgpack.Encoder().encode, msgspec.msgpack.Decoder(RowRecord).decode


def encode_row(number: int, row: HistoryRow, hashes: Mapping[str, str]) -> bytes:
    """Bytes of a row at a place from 0 on, -1 for one that has none; hashes: of the programs, by name."""
    return _encode_record(
        RowRecord(
            number=number,
            time=row.time.isoformat(),
            baseline=row.baseline.isoformat() if row.baseline else "",
            conditions=row.conditions.specified,
            verdicts={name: (hashes[name], ruling) for name, ruling in (row.verdicts or {}).items()},
            software=row.software,
            **{name: getattr(row, name) for name in SHARED_FIELDS},
        )
    )


def decode_row(content: bytes, hashes: Mapping[str, str], software: str = "") -> tuple[int, HistoryRow]:
    """Place and row, without rulings on programs that have changed since; ValueError where it is no row.

    software: that made a row which does not say so itself; empty for this version.
    """
    record = _decode_record(content)
    rulings = {name: ruling for name, (made_with, ruling) in record.verdicts.items() if hashes.get(name) == made_with}
    row = HistoryRow(
        tap_id=record.tap_id,
        time=datetime.fromisoformat(record.time),
        tool=record.tool,
        direction=record.direction,
        frequency=record.frequency,
        damping_ratio=record.damping_ratio,
        stiffness=record.stiffness,
        phase_deg=record.phase_deg,
        bearing_stiffness=record.bearing_stiffness,
        static_tip_stiffness=record.static_tip_stiffness,
        modal_tip_stiffness=record.modal_tip_stiffness,
        modes=record.modes,
        remarks=record.remarks,
        x=record.x,
        y=record.y,
        verdicts=rulings if rulings or not hashes else None,
        baseline=datetime.fromisoformat(record.baseline) if record.baseline else None,
        series=record.series,
        conditions=Conditions.from_mapping(record.conditions) if record.conditions else UNKNOWN_CONDITIONS,
        operator=record.operator,
        software=record.software or software,
    )
    return record.number, row
