"""One committed tap test as the journal tells of it."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Self

import msgspec

from acquisition import UNSAID, Conditions, DataError, Remark, TapTest

LATER = ("accepted", "excluded")
"""What other lines of the journal say of a tap test."""
TAP_LINE = b'{"kind": "tap", '
"""How the line of a tap test begins."""


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
    """Of that file."""
    size: int
    """Of that file (bytes)."""
    time: str
    """When it was taken (ISO 8601)."""
    tool: str
    """What was in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    source_sha256: str
    """Of the recording it was replayed from; empty for a live test."""
    conditions: Conditions = UNSAID
    """What it was taken under; unknown in lines of older versions."""
    asked: tuple[str, ...] = ()
    """What was asked about its time when it was committed, by code; lines of older versions have none."""
    accepted: tuple[str, ...] = ()
    """Questions about it that a person has accepted, by code; lines of their own."""
    excluded: str = ""
    """Why a person has taken it out of the series; empty where it counts; lines of their own."""

    @classmethod
    def of(cls, tap: TapTest, content: bytes) -> Self:
        """content: of its file."""
        about = tap.circumstances
        source = tap.source.sha256 if tap.source else ""
        digest = hashlib.sha256(content).hexdigest()
        named = about.created.isoformat(), about.tool, about.direction
        return cls(tap.id, digest, len(content), *named, source, about.conditions)

    @classmethod
    def from_line(cls, line: dict[str, Any], accepted: tuple[str, ...] = (), excluded: str = "") -> Self:
        """From the line of the journal that `line` has made."""
        told = line if line.get("conditions") else {name: value for name, value in line.items() if name != "conditions"}
        return msgspec.convert({**told, "accepted": accepted, "excluded": excluded}, cls)

    @property
    def line(self) -> dict[str, Any]:
        """For the journal."""
        told = {name: getattr(self, name) for name in self.__struct_fields__ if name not in LATER}
        return {"kind": "tap", **told, "conditions": self.conditions.known, "asked": list(self.asked)}

    @property
    def file(self) -> str:
        """Its place in the folder of the machine."""
        return f"taps/{self.id}.h5"


class _Line(msgspec.Struct, gc=False):
    """What a line says of a tap test."""

    id: str
    sha256: str
    size: int
    time: str
    tool: str
    direction: str
    source_sha256: str
    conditions: dict[str, Any] = {}
    asked: tuple[str, ...] = ()


_decode = msgspec.json.Decoder(list[_Line]).decode


def tap_entries(
    lines: Iterable[bytes], accepted: Mapping[str, tuple[str, ...]], excluded: Mapping[str, str]
) -> Iterator[TapEntry]:
    """From lines of the journal that begin with `TAP_LINE`, and what others say of them, by identity.

    Twenty times as fast as `TapEntry.from_line` of each.
    """
    for one in _decode(b"[" + b",".join(lines) + b"]"):
        conditions = msgspec.convert(one.conditions, Conditions) if one.conditions else UNSAID
        what = one.id, one.sha256, one.size, one.time, one.tool, one.direction, one.source_sha256
        later = accepted.get(one.id, ()), excluded.get(one.id, "")
        yield TapEntry(*what, conditions, one.asked, *later)
