"""A row of the history as bytes and back, value for value."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from typing import Any

import msgspec

from acquisition import UNSAID, Conditions, Remark
from lobewatch.analysis.estimate import Estimate
from lobewatch.analysis.history import Row, Values
from lobewatch.analysis.programs.verdict import Ruling


class Stored(msgspec.Struct, array_like=True, gc=False):
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


PLAIN = tuple(
    name for name in Stored.__struct_fields__ if name not in ("number", "time", "baseline", "conditions", "rulings")
)
"""Fields that are in a row just so."""
_encode, _decode = msgspec.msgpack.Encoder().encode, msgspec.msgpack.Decoder(Stored).decode


def packed(number: int, row: Row, hashes: Mapping[str, str]) -> bytes:
    """A row at a place from 0 on, -1 for one that has none; hashes: of the programs of machine.toml, by name."""
    baseline = row.baseline.isoformat() if row.baseline else ""
    rulings = {name: (hashes[name], ruling) for name, ruling in (row.rulings or {}).items()}
    plain = {name: getattr(row, name) for name in PLAIN}
    others: dict[str, Any] = {"baseline": baseline, "conditions": row.conditions.known, "rulings": rulings}
    return _encode(Stored(number=number, time=row.time.isoformat(), **others, **plain))


def unpacked(content: bytes, hashes: Mapping[str, str], software: str = "") -> tuple[int, Row]:
    """Place and row, without rulings on programs that have changed since; ValueError where it is of another make.

    software: that made a row which does not say so itself; empty for this version.
    """
    one = _decode(content)
    rulings = {name: ruling for name, (made, ruling) in one.rulings.items() if hashes.get(name) == made}
    return one.number, Row(
        tap_id=one.tap_id,
        time=datetime.fromisoformat(one.time),
        tool=one.tool,
        direction=one.direction,
        frequency=one.frequency,
        damping_ratio=one.damping_ratio,
        stiffness=one.stiffness,
        phase_deg=one.phase_deg,
        bearing_stiffness=one.bearing_stiffness,
        static_tip_stiffness=one.static_tip_stiffness,
        modal_tip_stiffness=one.modal_tip_stiffness,
        modes=one.modes,
        remarks=one.remarks,
        x=one.x,
        y=one.y,
        rulings=rulings if rulings or not hashes else None,
        software=one.software or software,
        series=one.series,
        conditions=Conditions.of(one.conditions) if one.conditions else UNSAID,
        baseline=datetime.fromisoformat(one.baseline) if one.baseline else None,
    )
