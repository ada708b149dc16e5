"""One committed tap test as the journal tells of it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Self

import msgspec

from acquisition import UNKNOWN_CONDITIONS, Conditions, DataError, Remark, TapTest
from modal import ModeEdits

NO_MODE_EDITS = ModeEdits()
"""Nobody chose modes."""
FIELDS_OF_OTHER_LINES = ("accepted", "excluded", "by_hand")
"""Fields of a tap test that other lines of the journal say."""
TAP_LINE_PREFIX = b'{"kind": "tap", '
"""Beginning of the line of a tap test."""


class DamagedTapError(DataError):
    """The file of a committed tap test is missing, altered or unreadable."""

    def __init__(self, remark: Remark, entry: TapEntry, path: Path) -> None:
        """path: of the folder."""
        super().__init__(f"{path}/{remark}")
        self.remark, self.entry = remark, entry


class TapEntry(msgspec.Struct, frozen=True, gc=False):
    """One committed tap test, a line of the journal."""

    id: str
    """Name of its file in taps/, without .h5."""
    sha256: str
    """SHA-256 of that file."""
    size: int
    """Size of that file (bytes)."""
    time: str
    """Time of the tap test (ISO 8601)."""
    tool: str
    """Tool in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    source_sha256: str
    """SHA-256 of the recording it was replayed from; empty for a live test."""
    conditions: Conditions = UNKNOWN_CONDITIONS
    """Conditions that it was taken under; unknown in lines of older versions."""
    asked: tuple[str, ...] = ()
    """Questions about its time when it was committed, by code; lines of older versions have none."""
    operator: str = ""
    """Who held the hammer; empty where nobody said so, and in lines of older versions."""
    accepted: tuple[str, ...] = ()
    """Questions about it that a person has accepted, by code; lines of their own."""
    excluded: str = ""
    """Reason why a person has taken it out of the series; empty where it counts; lines of their own."""
    by_hand: ModeEdits = NO_MODE_EDITS
    """Modes of it that a person chose; lines of their own."""

    @classmethod
    def of(cls, tap: TapTest, content: bytes) -> Self:
        """Entry of a tap test; content: of its file."""
        about = tap.circumstances
        source = tap.source.sha256 if tap.source else ""
        digest = hashlib.sha256(content).hexdigest()
        labels = about.created.isoformat(), about.tool, about.direction
        return cls(tap.id, digest, len(content), *labels, source, about.conditions, operator=about.operator)

    @classmethod
    def from_line(
        cls,
        line: dict[str, Any],
        accepted: tuple[str, ...] = (),
        excluded: str = "",
        by_hand: ModeEdits = NO_MODE_EDITS,
    ) -> Self:
        """Entry of the line of the journal that `line` has made."""
        fields = line if line.get("conditions") else {key: line[key] for key in line if key != "conditions"}
        entry = msgspec.convert({**fields, "accepted": accepted, "excluded": excluded}, cls)
        return msgspec.structs.replace(entry, by_hand=by_hand)

    @property
    def line(self) -> dict[str, Any]:
        """Line of the journal."""
        fields = {name: getattr(self, name) for name in self.__struct_fields__ if name not in FIELDS_OF_OTHER_LINES}
        return {"kind": "tap", **fields, "conditions": self.conditions.specified, "asked": list(self.asked)}

    @property
    def file(self) -> str:
        """Place of the file in the folder of the machine."""
        return f"taps/{self.id}.h5"


class _TapLine(msgspec.Struct, gc=False):
    """Fields of the line of a tap test."""

    id: str
    sha256: str
    size: int
    time: str
    tool: str
    direction: str
    source_sha256: str
    conditions: dict[str, Any] = {}
    asked: tuple[str, ...] = ()
    operator: str = ""


_decode_tap_lines = msgspec.json.Decoder(list[_TapLine]).decode


def decode_tap_entries(
    lines: Iterable[bytes],
    accepted: Mapping[str, tuple[str, ...]],
    excluded: Mapping[str, str],
    by_hand: Mapping[str, ModeEdits],
) -> Iterator[TapEntry]:
    """Entries of lines of the journal that begin with `TAP_LINE_PREFIX`, and what others say of them, by identity.

    Twenty times as fast as `TapEntry.from_line` of each.
    """
    for line in _decode_tap_lines(b"[" + b",".join(lines) + b"]"):
        conditions = msgspec.convert(line.conditions, Conditions) if line.conditions else UNKNOWN_CONDITIONS
        file, labels = (line.id, line.sha256, line.size), (line.time, line.tool, line.direction)
        later = accepted.get(line.id, ()), excluded.get(line.id, ""), by_hand.get(line.id, NO_MODE_EDITS)
        yield TapEntry(*file, *labels, line.source_sha256, conditions, line.asked, line.operator, *later)
