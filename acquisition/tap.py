"""One tap test: every hit, which of them were averaged, and the FRF they gave."""

from __future__ import annotations

import re
import secrets
from dataclasses import dataclass
from datetime import UTC, datetime

from acquisition.channel import TapDirection, tap_direction
from acquisition.frf import Frf
from acquisition.hit import Hit, HitFlags
from acquisition.names import check_name


@dataclass(frozen=True)
class Circumstances:
    """Who tapped what, when and where."""

    machine: str
    """Name of the machine."""
    created: datetime
    """When (timezone-aware)."""
    tool: str = ""
    """Name of the tool or assembly."""
    direction: TapDirection = "x"
    """Direction at the tool tip."""
    operator: str = ""
    """Who held the hammer."""
    machine_toml: str = ""
    """Text of the machine file at that time."""
    device: str = ""
    """What recorded it: model, serial number and firmware of the DAQ, and how lost scans were found."""

    def __post_init__(self) -> None:
        """Refuse a direction that is none, and a time without its zone."""
        tap_direction(self.direction)
        if self.created.tzinfo is None:
            raise ValueError(f"created={self.created} has no time zone; give one, e.g. datetime.now(UTC)")


@dataclass(frozen=True)
class SourceFile:
    """The recording that a replayed tap test was read from."""

    name: str
    """Its name, without folder."""
    content: bytes
    """Its bytes."""


@dataclass(frozen=True, eq=False)
class TapTest:
    """A finished tap test."""

    id: str
    """UTC time to the microsecond, machine, tool, direction and four random hex digits."""
    circumstances: Circumstances
    """Who, what, when."""
    frf: Frf
    """The averaged FRF."""
    hits: tuple[Hit, ...] = ()
    """All hits, also the refused ones; empty for a recorded FRF."""
    flags: tuple[HitFlags, ...] = ()
    """The verdict on each hit."""
    source: SourceFile | None = None
    """Where it was read from, for a replay."""

    @property
    def accepted(self) -> tuple[Hit, ...]:
        """The hits that were averaged."""
        return tuple(hit for hit, flags in zip(self.hits, self.flags, strict=True) if not flags)


def new_tap_id(circumstances: Circumstances) -> str:
    """An identity that sorts by time and is a file name on every system.

    Raises ValueError for a machine, tool or operator with control characters in its name: what is kept for good must
    be fit to be shown.
    """
    for what in ("machine", "tool", "operator"):
        check_name(getattr(circumstances, what), what)
    stamp = circumstances.created.astimezone(UTC).strftime("%Y%m%dT%H%M%S.%fZ")
    names = (circumstances.machine, circumstances.tool, circumstances.direction)
    slugs = [re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-")[:24] for name in names]
    return "_".join([stamp, *filter(None, slugs), secrets.token_hex(2)])
