"""A row of the history as bytes and back, value for value."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Any

import msgspec

from acquisition import UNSAID, Conditions, Remark
from lobewatch.history.history import Row, Values
from lobewatch.measuring.estimate import Estimate
from lobewatch.verdicts.verdict import Ruling


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
    modes: tuple[Values, ...]
    x: tuple[Values, ...]
    y: tuple[Values, ...]
    remarks: tuple[Remark, ...]
    rulings: dict[str, tuple[str, Ruling]]
    software: str = ""
    operator: str = ""


CONVERTED = ("number", "time", "baseline", "conditions", "rulings", "software")
"""Fields that a record has otherwise than a row."""
SHARED = tuple(name for name in RowRecord.__struct_fields__ if name not in CONVERTED)
"""Fields that both have alike."""
_encode, _decode = msgspec.msgpack.Encoder().encode, msgspec.msgpack.Decoder(RowRecord).decode


def encode_row(number: int, row: Row, hashes: Mapping[str, str]) -> bytes:
    """Bytes of a row at a place from 0 on, -1 for one that has none; hashes: of the programs, by name."""
    return _encode(
        RowRecord(
            number=number,
            time=row.time.isoformat(),
            baseline=row.baseline.isoformat() if row.baseline else "",
            conditions=row.conditions.known,
            rulings={name: (hashes[name], ruling) for name, ruling in (row.rulings or {}).items()},
            software=row.software,
            **{name: getattr(row, name) for name in SHARED},
        )
    )


def decode_row(content: bytes, hashes: Mapping[str, str], software: str = "") -> tuple[int, Row]:
    """Place and row, without rulings on programs that have changed since; ValueError where it is no row.

    software: that made a row which does not say so itself; empty for this version.
    """
    record = _decode(content)
    rulings = {name: ruling for name, (made_with, ruling) in record.rulings.items() if hashes.get(name) == made_with}
    row = Row(
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
        rulings=rulings if rulings or not hashes else None,
        baseline=datetime.fromisoformat(record.baseline) if record.baseline else None,
        series=record.series,
        conditions=Conditions.of(record.conditions) if record.conditions else UNSAID,
        operator=record.operator,
        software=record.software or software,
    )
    return record.number, row
