"""Encode and decode a history row."""

from collections.abc import Mapping
from datetime import datetime
from typing import Any

import msgspec

from acquisition import UNKNOWN_CONDITIONS, Conditions, Remark
from lobewatch.history.history import HistoryRow, ModeValues
from lobewatch.measurement.estimate import Estimate
from lobewatch.verdicts.verdict import StoredVerdict


class RowRecord(msgspec.Struct, array_like=True, gc=False):
    """Stored form of a row: times as text with their zone, and each verdict with the hash of its program."""

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


CONVERTED_FIELDS = ("number", "time", "baseline", "conditions", "verdicts")
"""Fields with another form than in a row."""
SHARED_FIELDS = tuple(name for name in RowRecord.__struct_fields__ if name not in CONVERTED_FIELDS)
"""Fields with the same form as in a row."""
_encode_record, _decode_record = msgspec.msgpack.Encoder().encode, msgspec.msgpack.Decoder(RowRecord).decode


def encode_row(number: int, row: HistoryRow, hashes: Mapping[str, str]) -> bytes:
    """Encode a row with its number, -1 for one outside of the history; hashes: of the programs by name."""
    values: dict[str, Any] = {name: getattr(row, name) for name in SHARED_FIELDS}
    values |= {"number": number, "time": row.time.isoformat(), "conditions": row.conditions.specified}
    values["baseline"] = row.baseline.isoformat() if row.baseline else ""
    values["verdicts"] = {name: (hashes[name], verdict) for name, verdict in (row.verdicts or {}).items()}
    return _encode_record(RowRecord(**values))


def decode_row(content: bytes, hashes: Mapping[str, str], software: str = "") -> tuple[int, HistoryRow]:
    """Decode number and row, without verdicts on changed programs; ValueError for invalid bytes.

    software: version of a row that does not state it; empty for this version.
    """
    record = _decode_record(content)
    values = {name: getattr(record, name) for name in SHARED_FIELDS}
    values |= {"time": datetime.fromisoformat(record.time), "software": record.software or software}
    values["baseline"] = datetime.fromisoformat(record.baseline) if record.baseline else None
    values["conditions"] = Conditions.from_mapping(record.conditions) if record.conditions else UNKNOWN_CONDITIONS
    stored = record.verdicts.items()
    verdicts = {name: verdict for name, (made_with, verdict) in stored if hashes.get(name) == made_with}
    values["verdicts"] = verdicts if verdicts or not hashes else None
    return record.number, HistoryRow(**values)
