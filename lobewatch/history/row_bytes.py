"""A row of the history as bytes and back, value for value."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from datetime import datetime
from functools import lru_cache
from operator import attrgetter
from typing import Any, get_type_hints

import msgspec

from acquisition import UNSAID, Conditions, Remark
from lobewatch.history.history import ESTIMATES, WATCHED, Row, Values, Watched
from lobewatch.measuring.estimate import Estimate
from lobewatch.measuring.questions.asked import ACCEPTED, QUESTIONS
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


PLAIN = tuple(
    name for name in RowRecord.__struct_fields__ if name not in ("number", "time", "baseline", "conditions", "rulings")
)
"""Fields that are in a row just so."""
LATER = ("modes", "x", "y", "remarks", "rulings")
"""Fields that few ask for."""
_KINDS: dict[str, Any] = dict.fromkeys(ESTIMATES, tuple[float, float]) | dict.fromkeys(LATER, msgspec.Raw)
_Brief = msgspec.defstruct(
    "_Brief",
    [(name, _KINDS.get(name, kind)) for name, kind in get_type_hints(RowRecord).items()],
    array_like=True,
    gc=False,
)
"""A row with those as they lie there, estimates as numbers."""
_encode, _decode = msgspec.msgpack.Encoder().encode, msgspec.msgpack.Decoder(RowRecord).decode
_put = object.__setattr__
_watched = attrgetter(*WATCHED)
_decode_brief: Callable[[bytes], Any] = msgspec.msgpack.Decoder(_Brief).decode
ASKING, ANSWERING = tuple(map(_encode, QUESTIONS)), _encode(ACCEPTED)
"""In the bytes of every remark that asks, and that tells of an answer."""
NO_QUESTIONS: dict[str, Any] = {"questions": ()}
NO_ANSWERS: dict[str, Any] = {"accepted": frozenset()}
"""Of rows whose remarks need not be decoded to know that."""


class StoredRow(Row):
    """A row as it was read: in each value as it was stored, those that few ask for decoded when they are asked for."""

    content: bytes = b""
    """As it lies there; empty in a row that `dataclasses.replace` has made of it."""
    brief: Any = None
    """Most of it; None in a row that `dataclasses.replace` has made of it."""
    hashes: Mapping[str, str] = {}
    """Of the programs of machine.toml."""
    made_by: str = ""
    """What has made it, where it does not say so itself."""

    @property
    def followed(self) -> Values:
        """As of any row; no estimates are made for it."""
        one = self.brief
        if one is None:
            return super().followed
        return one.frequency[0], one.damping_ratio[0], one.stiffness[0], one.phase_deg[0]

    @property
    def watched(self) -> Watched:
        """As of any row, likewise."""
        one = self.brief
        return super().watched if one is None else _watched(one)

    def __repr__(self) -> str:
        """As of any row: equal ones read alike."""
        return Row.__name__ + super().__repr__().removeprefix(type(self).__name__)


class _Lazy:
    """A field that is made where it is asked for."""

    def __init__(self, name: str, make: Callable[[StoredRow], Any]) -> None:
        self._name, self._make = name, make

    def __get__(self, row: StoredRow, kind: type | None = None) -> Any:
        """Found in the row itself from then on."""
        found = self._make(row)
        _put(row, self._name, found)
        return found


def _conditions(row: StoredRow) -> Conditions:
    return Conditions.of(row.brief.conditions) if row.brief.conditions else UNSAID


def _software(row: StoredRow) -> str:
    return str(row.brief.software or row.made_by)


def _estimate(name: str) -> Callable[[StoredRow], Estimate]:
    values = attrgetter(f"brief.{name}")
    return lambda row: Estimate(*values(row))


def _later(name: str) -> Callable[[StoredRow], Any]:
    """All of their kind are decoded together."""

    def make(row: StoredRow) -> Any:
        one, hashes = _decode(row.content), row.hashes
        rulings = {name: ruling for name, (made, ruling) in one.rulings.items() if hashes.get(name) == made}
        _put(row, "rulings", rulings if rulings or not hashes else None)
        for other in LATER[:-1]:
            _put(row, other, getattr(one, other))
        return row.__dict__[name]

    return make


_MADE: dict[str, Callable[[StoredRow], Any]] = {name: _estimate(name) for name in ESTIMATES}
_MADE |= {name: _later(name) for name in LATER} | {"conditions": _conditions, "software": _software}
for _name, _make in _MADE.items():
    setattr(StoredRow, _name, _Lazy(_name, _make))


def packed(number: int, row: Row, hashes: Mapping[str, str]) -> bytes:
    """A row at a place from 0 on, -1 for one that has none; hashes: of the programs of machine.toml, by name."""
    baseline = row.baseline.isoformat() if row.baseline else ""
    rulings = {name: (hashes[name], ruling) for name, ruling in (row.rulings or {}).items()}
    plain = {name: getattr(row, name) for name in PLAIN}
    others: dict[str, Any] = {"baseline": baseline, "conditions": row.conditions.known, "rulings": rulings}
    return _encode(RowRecord(number=number, time=row.time.isoformat(), **others, **plain))


def unpacked(content: bytes, hashes: Mapping[str, str], software: str = "") -> tuple[int, Row]:
    """Place and row, without rulings on programs that have changed since; ValueError where it is no row.

    software: that made a row which does not say so itself; empty for this version.
    """
    brief = _decode_brief(content)
    asks, answers = _about(bytes(brief.remarks))
    row = StoredRow.__new__(StoredRow)
    row.__dict__.update(
        content=content,
        brief=brief,
        hashes=hashes,
        made_by=software,
        tap_id=brief.tap_id,
        time=datetime.fromisoformat(brief.time),
        tool=brief.tool,
        direction=brief.direction,
        series=brief.series,
        baseline=datetime.fromisoformat(brief.baseline) if brief.baseline else None,
        static_tip_stiffness=brief.static_tip_stiffness,
        modal_tip_stiffness=brief.modal_tip_stiffness,
        **{} if asks else NO_QUESTIONS,
        **{} if answers else NO_ANSWERS,
    )
    return brief.number, row


def is_of_this_make(content: bytes) -> bool:
    """Whether all of a row can be decoded."""
    try:
        _decode(content)
    except ValueError:
        return False
    return True


@lru_cache(maxsize=1024)
def _about(remarks: bytes) -> tuple[bool, bool]:
    """Whether there can be one among them that asks, and one that tells of an answer."""
    return any(map(remarks.__contains__, ASKING)), ANSWERING in remarks
