"""One tap test: its conditions, all its hits and the averaged FRF."""

from __future__ import annotations

import hashlib
import re
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from datetime import UTC, datetime
from typing import Any, Self

from acquisition.channel import TapDirection, parse_direction
from acquisition.errors import DataError, check_name
from acquisition.frf import Frf
from acquisition.hit import Hit
from acquisition.hit_fault import HitFlags

CONDITION_RANGES = {
    "temperature_c": (-40.0, 150.0),
    "stick_out_mm": (0.1, 5000.0),
    "drawbar_kn": (0.1, 1000.0),
    "hours": (0.0, 1e6),
}
"""What a spindle can have: temperature (degC), stick-out of the tool (mm), drawbar force (kN), running hours (h)."""


@dataclass(frozen=True)
class Conditions:
    """What a tap test was taken under, as the shop says it and in its units; None or empty where nobody said.

    >>> usual = Conditions(stick_out_mm=42.0, state="cold")
    >>> Conditions(temperature_c=35.0, state="warm").over(usual).known
    {'temperature_c': 35.0, 'stick_out_mm': 42.0, 'state': 'warm'}
    """

    temperature_c: float | None = None
    """Temperature of the spindle (degC)."""
    stick_out_mm: float | None = None
    """Stick-out of the tool (mm)."""
    drawbar_kn: float | None = None
    """Force of the drawbar (kN)."""
    state: str = ""
    """State of the machine, in a word or two of the shop's: "warm", "gearbox low"."""
    reclamped: bool = False
    """Whether the tool was clamped anew for it; False: nobody said so."""
    note: str = ""
    """Anything else that is to be remembered."""
    hours: float | None = None
    """Running hours of the spindle (h)."""

    def __post_init__(self) -> None:
        """Refuse values that no spindle has, and control characters."""
        for name, (low, high) in CONDITION_RANGES.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise ValueError(f"{name}={value:g} is outside {low:g} to {high:g}; correct it, or leave it out")
        for name in ("state", "note"):
            check_name(getattr(self, name), name)

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> Self:
        """From what `known` has told, among other things."""
        return cls(**{field.name: mapping[field.name] for field in fields(cls) if field.name in mapping})

    @property
    def specified(self) -> dict[str, Any]:
        """What somebody said, by name."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in values.items() if value not in (None, "") and value is not False}

    def with_defaults(self, other: Self) -> Self:
        """The same, with what the other one knows where this one does not."""
        return replace(other, **self.specified)


UNKNOWN_CONDITIONS = Conditions()
"""Nobody said anything."""


@dataclass(frozen=True)
class Circumstances:
    """Who tapped what, when and where.

    >>> from datetime import UTC, datetime
    >>> tested = Circumstances("Mill 3", datetime(2026, 3, 2, 9, 30, tzinfo=UTC), tool="D16", direction="y")
    >>> tested.conditions == UNKNOWN_CONDITIONS
    True
    """

    machine: str
    """Name of the machine."""
    created: datetime
    """Time of the tap test (timezone-aware)."""
    tool: str = ""
    """Name of the tool or assembly."""
    direction: TapDirection = "x"
    """Direction at the tool tip."""
    operator: str = ""
    """Name of the person who held the hammer."""
    machine_toml: str = ""
    """Text of the machine file at that time."""
    device: str = ""
    """Recording device: model, serial number and firmware of the DAQ, and how lost scans were found."""
    conditions: Conditions = UNKNOWN_CONDITIONS
    """Temperature, clamping, state; of files without them, unknown."""

    def __post_init__(self) -> None:
        """Refuse a direction that is none, and a time without its zone."""
        parse_direction(self.direction)
        if self.created.tzinfo is None:
            raise ValueError(f"created={self.created} has no time zone; give one, e.g. datetime.now(UTC)")


@dataclass(frozen=True)
class SourceFile:
    """The recording that a replayed tap test was read from.

    >>> SourceFile("hit.lvm", b"abc").sha256[:16]  # FIPS 180-2, appendix B.1
    'ba7816bf8f01cfea'
    """

    name: str
    """Name of the file, without folder."""
    content: bytes
    """Bytes of the file; none where it was a live tap test of ours, all of whose hits the replayed one holds."""
    digest: str = ""
    """SHA-256 of the file where the bytes are not kept."""

    @property
    def sha256(self) -> str:
        """Of its bytes, kept or not."""
        return self.digest or hashlib.sha256(self.content).hexdigest()

    @property
    def without_content(self) -> Self:
        """Its name and its SHA-256 alone."""
        return replace(self, content=b"", digest=self.sha256)


@dataclass(frozen=True, eq=False)
class TapTest:
    """A finished tap test."""

    id: str
    """UTC time to the microsecond, machine, tool, direction and four random hex digits."""
    circumstances: Circumstances
    """Circumstances: who, what, when."""
    frf: Frf | None
    """The averaged FRF; None where no force was measured."""
    hits: tuple[Hit, ...] = ()
    """All hits, also the refused ones; empty for a recorded FRF."""
    flags: tuple[HitFlags, ...] = ()
    """The verdict on each hit."""
    source: SourceFile | None = None
    """File it was read from, for a replay."""

    @property
    def required_frf(self) -> Frf:
        """The averaged FRF; DataError where no force was measured."""
        if self.frf is None:
            raise DataError(f"{self.id}: no force was measured, so it has no FRF; tap with a hammer that measures it")
        return self.frf

    @property
    def accepted(self) -> tuple[Hit, ...]:
        """The hits that were averaged."""
        return tuple(hit for hit, flags in zip(self.hits, self.flags, strict=True) if not flags)


def new_tap_id(circumstances: Circumstances) -> str:
    """An identity that sorts by time and is a file name on every system.

    Raises ValueError for a machine, tool or operator with control characters in its name: what is kept for good must
    be fit to be shown.

    >>> from datetime import UTC, datetime
    >>> identity = new_tap_id(Circumstances("Mill 3", datetime(2026, 3, 2, 9, 30, tzinfo=UTC), tool="D16"))
    >>> identity[:-4], parse_machine_name(identity)  # four random digits end it
    ('20260302T093000.000000Z_Mill-3_D16_x_', 'Mill-3')
    """
    for label in ("machine", "tool", "operator"):
        check_name(getattr(circumstances, label), label)
    stamp = circumstances.created.astimezone(UTC).strftime("%Y%m%dT%H%M%S.%fZ")
    names = (circumstances.machine, circumstances.tool, circumstances.direction)
    return "_".join([stamp, *filter(None, map(sanitize_id_part, names)), secrets.token_hex(2)])


def sanitize_id_part(name: str) -> str:
    """A name as it stands in identities; empty where nothing of it can.

    >>> sanitize_id_part("Mill 3 / old"), sanitize_id_part("Fräse")
    ('Mill-3-old', 'Fr-se')
    """
    return re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-")[:24]


def parse_machine_name(tap_id: str) -> str:
    """Name of the machine as it stands in an identity; empty where that is none of `new_tap_id`.

    >>> parse_machine_name("20260302T093000.000000Z_Mill-3_D16_x_1a2b"), parse_machine_name("hit.lvm")
    ('Mill-3', '')
    """
    return tap_id.split("_")[1] if re.match(r"\d{8}T\d{6}\.\d{6}Z_", tap_id) else ""
