"""A row of the history as bytes and back, value for value."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from datetime import datetime
from functools import cached_property
from typing import Any, get_type_hints

import msgspec

from acquisition import UNSAID, Conditions, Remark
from lobewatch.analysis.estimate import Estimate
from lobewatch.analysis.history import ESTIMATES, Row, Values
from lobewatch.analysis.programs.verdict import Ruling
from lobewatch.analysis.questions.asked import ACCEPTED, QUESTIONS


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
NOW = ("tap_id", "tool", "direction", "series", "static_tip_stiffness", "modal_tip_stiffness")
"""Fields that are decoded at once, besides those that are made of text."""
LATER = ("modes", "x", "y", "remarks", "rulings")
"""Fields that few ask for."""
_KINDS: dict[str, Any] = dict.fromkeys(ESTIMATES, tuple[float, float]) | dict.fromkeys(LATER, msgspec.Raw)
_Brief = msgspec.defstruct(
    "_Brief",
    [(name, _KINDS.get(name, kind)) for name, kind in get_type_hints(Stored).items()],
    array_like=True,
    gc=False,
)
"""A row with those as they lie there, estimates as numbers."""
_encode, _decode = msgspec.msgpack.Encoder().encode, msgspec.msgpack.Decoder(Stored).decode
_put = object.__setattr__
_decode_brief: Callable[[bytes], Any] = msgspec.msgpack.Decoder(_Brief).decode
REMARKED = _encode("code")
"""In the bytes of every remark."""
ASKING, ANSWERING = tuple(map(_encode, QUESTIONS)), _encode(ACCEPTED)
"""In the bytes of every remark that asks, and that tells of an answer."""
NONE = frozenset[str]()


class _Later:
    """A field that is decoded, with all of its kind, when one of them is asked for."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, row: StoredRow, kind: type | None = None) -> Any:
        """Found in the row itself from then on."""
        found = _later(row.content, row.hashes)
        for name in LATER:
            _put(row, name, found[name])
        return found[self._name]


class _Estimated:
    """A value with its error, made where it is asked for."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, row: StoredRow, kind: type | None = None) -> Estimate:
        """Found in the row itself from then on."""
        found = Estimate(*getattr(row.brief, self._name))
        _put(row, self._name, found)
        return found


class _Conditioned:
    """What it was taken under, checked where it is asked for."""

    def __get__(self, row: StoredRow, kind: type | None = None) -> Conditions:
        """Found in the row itself from then on."""
        found = Conditions.of(row.brief.conditions)
        _put(row, "conditions", found)
        return found


class StoredRow(Row):
    """A row as it was read: in each value as it was stored, most of them decoded when one is asked for."""

    brief: Any = None
    """What was decoded at once; None in a row that `dataclasses.replace` has made of it."""
    content: bytes = b""
    """As it lies there; empty in such a row."""
    hashes: Mapping[str, str] = {}
    """Of the programs of machine.toml."""

    @cached_property
    def questions(self) -> tuple[Remark, ...]:
        """As of any row; its remarks are decoded where there can be any among them."""
        return super().questions if not self.content or _asks(self.content) else ()

    @cached_property
    def accepted(self) -> frozenset[str]:
        """As of any row; its remarks are decoded where there can be any among them."""
        return super().accepted if not self.content or ANSWERING in self.content else NONE

    @property
    def followed(self) -> Values:
        """As of any row; no estimates are made for it."""
        one = self.brief
        if one is None:
            return super().followed
        return one.frequency[0], one.damping_ratio[0], one.stiffness[0], one.phase_deg[0]

    def __repr__(self) -> str:
        """As of any row: equal ones read alike."""
        return Row.__name__ + super().__repr__().removeprefix(type(self).__name__)


_LAZY: dict[str, object] = {name: _Later(name) for name in LATER} | {name: _Estimated(name) for name in ESTIMATES}
for _name, _field in (_LAZY | {"conditions": _Conditioned()}).items():
    setattr(StoredRow, _name, _field)


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
    one = _decode_brief(content)
    row = StoredRow.__new__(StoredRow)
    for name in NOW:
        _put(row, name, getattr(one, name))
    _put(row, "time", datetime.fromisoformat(one.time))
    _put(row, "baseline", datetime.fromisoformat(one.baseline) if one.baseline else None)
    _put(row, "software", one.software or software)
    _put(row, "brief", one)
    _put(row, "content", content)
    _put(row, "hashes", hashes)
    if not one.conditions:
        _put(row, "conditions", UNSAID)
    if REMARKED not in content:
        _put(row, "questions", ())
        _put(row, "accepted", NONE)
    return one.number, row


def is_of_this_make(content: bytes) -> bool:
    """Whether all of a row can be decoded, not only what `unpacked` does at once."""
    try:
        _decode(content)
    except ValueError:
        return False
    return True


def _asks(content: bytes) -> bool:
    return any(map(content.__contains__, ASKING))


def _later(content: bytes, hashes: Mapping[str, str]) -> dict[str, Any]:
    one = _decode(content)
    rulings = {name: ruling for name, (made, ruling) in one.rulings.items() if hashes.get(name) == made}
    made = {"rulings": rulings if rulings or not hashes else None}
    return made | {name: getattr(one, name) for name in LATER if name not in made}
