"""Journal lines for tap tests."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, Self

import msgspec

from acquisition import UNKNOWN_CONDITIONS, Conditions, DataError, HitDecision, Remark, TapTest
from lobewatch.machine.journal.mass_checks import MassCheckEntry, SensorChain, proves_sensitivities
from modal import ModeEdits

NO_MODE_EDITS = ModeEdits()
"""No mode edits."""
FIELDS_OF_OTHER_LINES = ("accepted", "excluded", "by_hand", "hit_decisions")
"""Fields of a tap test that come from other journal lines."""
ONE_HIT_CODE = "one-hit"
"""Code of the question about a tap test of a single hit, asked when the test is stored."""
TAP_LINE_PREFIX = b'{"kind": "tap", '
"""Beginning of the line of a tap test."""


class DamagedTapError(DataError):
    """Raised when the file of a committed tap test is missing, altered or unreadable."""

    def __init__(self, remark: Remark, entry: TapEntry, path: Path) -> None:
        """Make the error for a file.

        Parameters
        ----------
        remark
            Damage of the file.
        entry
            Journal entry of the tap test.
        path
            Machine folder.
        """
        super().__init__(f"{path}/{remark}")
        self.remark, self.entry = remark, entry


class TapEntry(msgspec.Struct, frozen=True, gc=False):
    """Committed tap test, a line of the journal."""

    id: str
    """Name of the file in taps/, without .h5."""
    sha256: str
    """SHA-256 of the file."""
    size: int
    """Size of the file (bytes)."""
    time: str
    """Time of the tap test (ISO 8601)."""
    tool: str
    """Tool in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    source_sha256: str
    """SHA-256 of the replayed recording; empty for a live test."""
    conditions: Conditions = UNKNOWN_CONDITIONS
    """Conditions of the tap test; unknown in lines of older versions."""
    asked: tuple[str, ...] = ()
    """Codes of the questions about its time and device at the commit; empty in lines of older versions."""
    operator: str = ""
    """Name of the operator; empty if unknown and in lines of older versions."""
    chain: SensorChain | None = None
    """Measurement chain; None in lines of older versions, for replayed tests and without a force sensor."""
    asked_live: tuple[str, ...] = ()
    """Codes of the questions that were asked and answered before its first hit; older versions ignore them."""
    accepted: tuple[str, ...] = ()
    """Codes of its accepted questions, from other lines."""
    excluded: str = ""
    """Reason of its exclusion, from other lines; empty if included."""
    by_hand: ModeEdits = NO_MODE_EDITS
    """Mode edits, from other lines."""
    hit_decisions: tuple[HitDecision, ...] = ()
    """Decisions on its hits that count, from other lines."""
    is_mass_checked: bool = False
    """True if checks with a known mass show that its sensitivities are right, from other lines."""

    @classmethod
    def of(cls, tap: TapTest, content: bytes) -> Self:
        """Make the entry of a tap test.

        Parameters
        ----------
        tap
            Tap test.
        content
            Bytes of its file.
        """
        about = tap.circumstances
        source = tap.source.sha256 if tap.source else ""
        digest = hashlib.sha256(content).hexdigest()
        labels = about.created.isoformat(), about.tool, about.direction
        asked = (ONE_HIT_CODE,) if len(tap.accepted) == 1 else ()
        known, chain = (about.conditions, asked, about.operator), SensorChain.of_tap(tap)
        return cls(tap.id, digest, len(content), *labels, source, *known, chain, hit_decisions=tap.decisions)

    @classmethod
    def from_line(cls, line: dict[str, Any]) -> Self:
        """Read the entry from its journal line.

        Parameters
        ----------
        line
            Fields of the line.
        """
        return msgspec.convert({key: line[key] for key in line if key != "conditions" or line[key]}, cls)

    def with_mass_checks(self, checks: Sequence[MassCheckEntry]) -> TapEntry:
        """Return the entry, marked if checks show that its sensitivities are right.

        Parameters
        ----------
        checks
            Checks with a known mass, oldest first.
        """
        if not proves_sensitivities(self.chain, self.created, checks):
            return self
        return msgspec.structs.replace(self, is_mass_checked=True)

    @property
    def created(self) -> datetime:
        """Time of the tap test."""
        return datetime.fromisoformat(self.time)

    @property
    def line(self) -> dict[str, Any]:
        """Journal line."""
        left_out = (*FIELDS_OF_OTHER_LINES, "chain", "asked_live", "is_mass_checked")
        fields = {name: getattr(self, name) for name in self.__struct_fields__ if name not in left_out}
        fields |= {"conditions": self.conditions.specified, "asked": list(self.asked)}
        fields |= {} if self.chain is None else {"chain": msgspec.to_builtins(self.chain)}
        return {"kind": "tap", **fields} | ({"asked_live": list(self.asked_live)} if self.asked_live else {})

    @property
    def file(self) -> str:
        """Path of the file in the machine folder."""
        return f"taps/{self.id}.h5"


def decode_tap_entries(lines: Iterable[bytes]) -> list[TapEntry]:
    """Read the entries of lines with `TAP_LINE_PREFIX`, twenty times as fast as each with `TapEntry.from_line`."""
    return msgspec.json.decode(b"[" + b",".join(lines) + b"]", type=list[TapEntry])
