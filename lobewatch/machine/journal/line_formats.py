"""Kinds, fields and types of journal lines that this version understands, and faults of all other lines.

A line carries the number of its format. Lines of a newer version are kept and named, never guessed and never rewritten.
"""

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from datetime import datetime
from typing import Annotated, Any, NamedTuple

import msgspec

from acquisition import HitDecision, TapDirection
from lobewatch.machine.journal.alarm_entries import Acknowledgement, FleetScatter
from lobewatch.machine.journal.entries import CUT_LINE_KIND, CutEntry, parse_cut_line
from lobewatch.machine.journal.mass_checks import MASS_CHECK_KIND, MassCheckEntry
from lobewatch.machine.journal.tap_entry import TAP_LINE_PREFIX, TapEntry
from modal import ModeEdits

JOURNAL_FORMAT = 2
"""Number of the newest format, raised with every new kind, field or value.

1: lines without a number. 2: kind "join", test cuts by the "display" of the drive, "upload" of a cut.
"""
FORMAT_KEY, JOINED_KEY = "format", "joined"
"""Keys of the number of the format, and of the mark of the line of another computer that a line was joined from."""
BATCH_KEY = "batch"
"""Key of the number of the first line of the same write; missing for a single line."""
HIT_LINE_KIND, JOIN_LINE_KIND = "hit", "join"
"""Kinds of the lines of a decision on a hit, and of a joined journal."""
ZonedTime = Annotated[datetime, msgspec.Meta(tz=True)]
"""Time with a time zone."""


class LineFrame(msgspec.Struct, frozen=True):
    """Fields that lines of all kinds have."""

    kind: str
    """Kind of the line."""
    previous: str = ""
    """SHA-256 of the line before."""
    crc: int = 0
    """CRC-32 of the other fields."""
    number: int = 0
    """Number of the line; missing in the first version."""
    batch: int = 0
    """Number of the first line of the same write."""
    format: int = 1
    """Number of the format."""
    joined: str = ""
    """Mark of the line that it was joined from, see `compute_fact_mark`."""
    time: Any = None
    """Time of writing, except in kinds that define it."""


class _AboutTap(msgspec.Struct):
    tap: str


class _Accept(_AboutTap):
    code: str


class _Exclude(_AboutTap):
    reason: str


class _Lost(msgspec.Struct):
    tap: str = ""
    line: int = 0


class _Event(msgspec.Struct):
    id: str
    date: ZonedTime
    text: str
    new_baseline: bool


class _Withdrawal(msgspec.Struct):
    withdraws: str


class _Note(msgspec.Struct):
    text: str


class ConflictingEntries(msgspec.Struct, frozen=True):
    """Two entries of two computers on the same subject, of which one counts."""

    about: str
    """Identity of the tap test, test cut, mass check or alarm."""
    kept: dict[str, Any]
    """Entry that counts: the newer one."""
    other: dict[str, Any]
    """Entry that does not count."""


class JoinEntry(msgspec.Struct, frozen=True):
    """Journal of another computer, joined to this one."""

    file: str
    """File of the joined journal."""
    lines: int
    """Number of lines that were new."""
    renumbered: dict[str, str] = {}
    """New identities by those in the joined journal."""
    contradictions: tuple[ConflictingEntries, ...] = ()
    """Contradictions between the two journals."""


def _convert(*types: type) -> Callable[[Mapping[str, Any]], Sequence[object]]:
    return lambda line: [msgspec.convert(line, kind) for kind in types]


def _read_cut(line: Mapping[str, Any]) -> Sequence[object]:
    return msgspec.convert(line, CutEntry), parse_cut_line(line)


class _LineKind(NamedTuple):
    types: tuple[type, ...]
    read: Callable[[Mapping[str, Any]], Sequence[object]]

    @property
    def fields(self) -> set[str]:
        """Known fields."""
        return {name for kind in (LineFrame, *self.types) for name in _field_names(kind)}


def _field_names(kind: Any) -> Iterator[str]:
    yield from (
        kind.__struct_fields__ if hasattr(kind, "__struct_fields__") else getattr(kind, "__dataclass_fields__", ())
    )


def _kind_of(*types: type) -> _LineKind:
    return _LineKind(types, _convert(*types))


LINE_KINDS = {
    "tap": _LineKind((TapEntry,), lambda line: _convert(_TAP_LINE)(_without_empty_conditions(line))),
    CUT_LINE_KIND: _LineKind((CutEntry,), _read_cut),
    MASS_CHECK_KIND: _kind_of(MassCheckEntry),
    "ack": _kind_of(Acknowledgement),
    "scatter": _kind_of(FleetScatter),
    HIT_LINE_KIND: _kind_of(_AboutTap, HitDecision),
    "modes": _kind_of(_AboutTap, ModeEdits),
    "accept": _kind_of(_Accept),
    "exclude": _kind_of(_Exclude),
    "include": _kind_of(_AboutTap),
    "lost": _kind_of(_Lost),
    "event": _kind_of(_Event),
    "withdrawal": _kind_of(_Withdrawal),
    JOIN_LINE_KIND: _kind_of(JoinEntry),
    "note": _kind_of(_Note),
}
"""Kinds of lines by name; an event with `withdraws` is a withdrawal, a note has no effect."""


def _make_tap_line(*, accepts_others: bool) -> type:
    """Make the type of a whole line of a tap test; accepts_others: True to accept unknown fields and newer formats."""
    strict: dict[str, Any] = {"time": ZonedTime, "direction": TapDirection}
    strict |= {} if accepts_others else {FORMAT_KEY: Annotated[int, msgspec.Meta(le=JOURNAL_FORMAT)]}
    own = msgspec.structs.fields(TapEntry)
    names = {field.name for field in own}
    others = [field for field in msgspec.structs.fields(LineFrame) if field.name not in names]
    fields = [_field_of(field, strict) for field in (*own, *others)]
    return msgspec.defstruct("_TapLine", fields, forbid_unknown_fields=not accepts_others, kw_only=True, gc=False)


def _field_of(field: msgspec.structs.FieldInfo, types: Mapping[str, Any]) -> Any:
    kind = types.get(field.name, field.type)
    return (field.name, kind) if field.required else (field.name, kind, field.default)


_TAP_LINE: type = _make_tap_line(accepts_others=True)
_check_tap_lines = msgspec.json.Decoder(list[_make_tap_line(accepts_others=False)]).decode  # type: ignore[misc]


def _without_empty_conditions(line: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in line.items() if key != "conditions" or value}


class LineFault(NamedTuple):
    """Line that this version does not understand, or only in part."""

    number: int
    """Number of the line in the journal."""
    text: str
    """Fault."""
    format: int
    """Number of its format."""
    is_used: bool
    """True if the known fields of the line are used."""

    @property
    def is_newer(self) -> bool:
        """True if a newer version of lobewatch wrote the line."""
        return self.format > JOURNAL_FORMAT

    def __str__(self) -> str:
        by = f"written by a newer version (format {self.format})" if self.is_newer else "damaged"
        return f"line {self.number} is {by}: {self.text}"


def find_line_faults(lines: Sequence[bytes], *, of_taps: bool) -> tuple[LineFault, ...]:
    """Find the lines that this version does not understand.

    Parameters
    ----------
    lines
        Sound lines of a journal, oldest first.
    of_taps
        True for the lines with `TAP_LINE_PREFIX`, which are many, False for all others.
    """
    chosen = [(number, line) for number, line in enumerate(lines, 1) if line.startswith(TAP_LINE_PREFIX) is of_taps]
    if of_taps:
        try:
            _check_tap_lines(b"[" + b",".join(line for _, line in chosen) + b"]")
            return ()
        except msgspec.MsgspecError:
            pass
    faults = (_find_line_fault(number, line) for number, line in chosen)
    return tuple(fault for fault in faults if fault is not None)


def _find_line_fault(number: int, line: bytes) -> LineFault | None:
    entry: dict[str, Any] = json.loads(line)
    written = entry.get(FORMAT_KEY, 1)
    written = written if isinstance(written, int) else JOURNAL_FORMAT + 1
    name = "withdrawal" if entry["kind"] == "event" and "withdraws" in entry else entry["kind"]
    kind = LINE_KINDS.get(name) if isinstance(name, str) else None
    if kind is None:
        return LineFault(number, f"kind {name!r} is unknown", written, is_used=False)
    try:
        msgspec.json.decode(line)  # accepts no infinite number
        msgspec.convert(entry, LineFrame)
        read = kind.read(entry)
        _refuse_local_times(read)
    except (ValueError, TypeError, LookupError, AttributeError) as error:
        return LineFault(number, f"{name}: {_explain(error)}", written, is_used=False)
    understood: dict[str, Any] = dict.fromkeys(kind.fields)
    for one in read:
        understood |= msgspec.to_builtins(one)
    unknown = ", ".join(sorted(_find_unknown_fields(entry, understood)))
    return LineFault(number, f"{name}: unknown field {unknown}", written, is_used=True) if unknown else None


def _find_unknown_fields(written: object, understood: object, place: str = "") -> Iterator[str]:
    """Yield the fields of a line and of its tables that this version does not understand."""
    if isinstance(written, dict) and isinstance(understood, dict):
        yield from (f"{place}{key}" for key in written.keys() - understood.keys())
        for key in written.keys() & understood.keys():
            yield from _find_unknown_fields(written[key], understood[key], f"{place}{key}.")
    elif isinstance(written, list) and isinstance(understood, list):
        for pair in zip(written, understood, strict=False):
            yield from _find_unknown_fields(*pair, place)


def _refuse_local_times(values: Iterable[object]) -> None:
    for value in values if isinstance(values, list) else ():
        for name in _field_names(type(value)):
            time = getattr(value, name)
            if isinstance(time, datetime) and time.tzinfo is None:
                raise ValueError(f"{name} {time} has no time zone")


def _explain(error: Exception) -> str:
    """Explain the fault of a field."""
    found = re.fullmatch(r"Expected `(.+)`, got `(.+)` - at `\$\.(.+)`", str(error))
    return f"{found[3]} is of type {found[2]}, not {found[1]}" if found else str(error)
