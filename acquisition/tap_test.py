"""One tap test: its conditions, all its hits and the averaged FRF."""

import hashlib
import re
import secrets
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from datetime import UTC, datetime
from typing import Any, Literal, Self

from acquisition.channel import TapDirection, parse_direction
from acquisition.credentials import hide_passwords
from acquisition.errors import DataError, check_name
from acquisition.frf import Frf
from acquisition.hit import Hit
from acquisition.hit_fault import HitFlags
from acquisition.source import DeviceIdentity

SERIAL_PREFIX = "serial number "
"""Words before the serial number in the description of a device."""
CONDITION_RANGES = {
    "temperature_c": (-40.0, 150.0),
    "stick_out_mm": (0.1, 5000.0),
    "drawbar_kn": (0.1, 1000.0),
    "hours": (0.0, 1e6),
}
"""Range of temperature (degC), stick-out of the tool (mm), drawbar force (kN) and running hours (h) of a spindle."""


@dataclass(frozen=True)
class Conditions:
    """Conditions of a tap test in the units of the shop; None or empty if unknown.

    Examples
    --------
    >>> usual = Conditions(stick_out_mm=42.0, state="cold")
    >>> Conditions(temperature_c=35.0, state="warm").with_defaults(usual).specified
    {'temperature_c': 35.0, 'stick_out_mm': 42.0, 'state': 'warm'}
    """

    temperature_c: float | None = None
    """Temperature of the spindle (degC)."""
    stick_out_mm: float | None = None
    """Stick-out of the tool (mm)."""
    drawbar_kn: float | None = None
    """Force of the drawbar (kN)."""
    state: str = ""
    """State of the machine in a word or two: "warm", "gearbox low"."""
    reclamped: bool = False
    """True if the tool was reclamped for the test; False if unknown."""
    note: str = ""
    """Free note."""
    hours: float | None = None
    """Running hours of the spindle (h)."""

    def __post_init__(self) -> None:
        for name, (low, high) in CONDITION_RANGES.items():
            value = getattr(self, name)
            if value is not None and not low <= value <= high:
                raise ValueError(f"{name}={value:g} is outside {low:g} to {high:g}. Correct or omit this value.")
        for name in ("state", "note"):
            check_name(getattr(self, name), name)

    @classmethod
    def from_mapping(cls, mapping: Mapping[str, Any]) -> Self:
        """Return the conditions among the entries of a mapping.

        Parameters
        ----------
        mapping
            Values by name, as `specified` gives them; other entries are ignored.
        """
        return cls(**{field.name: mapping[field.name] for field in fields(cls) if field.name in mapping})

    @property
    def specified(self) -> dict[str, Any]:
        """Known conditions by name."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in values.items() if value not in (None, "") and value is not False}

    def with_defaults(self, other: Self) -> Self:
        """Return these conditions, completed by others.

        Parameters
        ----------
        other
            Conditions to use where these are unknown.
        """
        return replace(other, **self.specified)


UNKNOWN_CONDITIONS = Conditions()
"""Conditions that are all unknown."""


def parse_device(text: str) -> DeviceIdentity:
    """Return model and serial number from the text that a tap test keeps of its recording device.

    A comma and a space end either, as the text has no other mark between its parts.

    Parameters
    ----------
    text
        Model, serial number and more, joined with ", ".

    Examples
    --------
    >>> parse_device("DI-2108, serial number 5C76F3AA, firmware 1.03").serial
    '5C76F3AA'
    """
    model, *details = text.split(", ")
    serials = [part.removeprefix(SERIAL_PREFIX) for part in details if part.startswith(SERIAL_PREFIX)]
    return DeviceIdentity(model, next(iter(serials), ""))


@dataclass(frozen=True)
class Circumstances:
    """Operator, machine, tool, direction and time of a tap test.

    Examples
    --------
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
    """Name of the person with the hammer."""
    machine_toml: str = ""
    """Text of the machine file at that time, without passwords."""
    device: str = ""
    """Recording device: model, serial number and firmware of the DAQ, and how lost scans were detected."""
    conditions: Conditions = UNKNOWN_CONDITIONS
    """Temperature, clamping, state; unknown in files without them."""

    def __post_init__(self) -> None:
        parse_direction(self.direction)
        if self.created.tzinfo is None:
            raise ValueError(f"created={self.created} has no time zone. Give one, as in datetime.now(UTC).")
        object.__setattr__(self, "machine_toml", hide_passwords(self.machine_toml))

    @property
    def device_identity(self) -> DeviceIdentity:
        """Model and serial number of the recording device; empty if unknown."""
        return parse_device(self.device)

    @property
    def is_emulated(self) -> bool:
        """True if the recording device is emulated."""
        return self.device_identity.is_emulated


@dataclass(frozen=True)
class SourceFile:
    """Recording that a replayed tap test was read from.

    Examples
    --------
    >>> SourceFile("hit.lvm", b"abc").sha256[:16]  # FIPS 180-2, appendix B.1
    'ba7816bf8f01cfea'
    """

    name: str
    """Name of the file, without folder."""
    content: bytes
    """Bytes of the file; empty for a live tap test of lobewatch, all of whose hits the replayed test holds."""
    digest: str = ""
    """SHA-256 of the file where the bytes are not kept."""

    @property
    def sha256(self) -> str:
        """SHA-256 of the bytes, kept or not."""
        return self.digest or hashlib.sha256(self.content).hexdigest()

    @property
    def without_content(self) -> Self:
        """Name and SHA-256 without the bytes."""
        return replace(self, content=b"", digest=self.sha256)


@dataclass(frozen=True)
class HitDecision:
    """Decision of a person on one hit, which overrides the evaluation of that hit.

    Examples
    --------
    >>> accepted, rejected = HitDecision(3, "accept", ("double-hit",)), HitDecision(5, "reject")
    >>> accepted.apply(HitFlags.DOUBLE_HIT), rejected.apply(HitFlags.OK).codes
    (<HitFlags.OK: 0>, ('undone',))
    >>> str(accepted), str(rejected)
    ('accept 3:double-hit', 'reject 5')
    """

    hit: int
    """Number of the hit in its tap test, from 1."""
    decision: Literal["accept", "reject", "undo"]
    """Decision; "undo" withdraws the earlier ones on this hit."""
    codes: tuple[str, ...] = ()
    """Codes of the accepted faults; empty for the other decisions."""

    def apply(self, faults: HitFlags) -> HitFlags:
        """Return the flags of the hit after the decision.

        Parameters
        ----------
        faults
            Faults that the evaluation found.
        """
        if self.decision == "accept":
            return faults & ~HitFlags.from_codes(self.codes)
        return faults | HitFlags.UNDONE if self.decision == "reject" else faults

    def __str__(self) -> str:
        return " ".join([self.decision, ":".join([f"{self.hit}", *filter(None, [",".join(self.codes)])])])


def decide_flags(faults: Iterable[HitFlags], decisions: Iterable[HitDecision]) -> tuple[HitFlags, ...]:
    """Return the flags of each hit after decisions, at most one per hit.

    Parameters
    ----------
    faults
        Faults that the evaluation found in each hit.
    decisions
        Decisions that count.

    Examples
    --------
    >>> faults = HitFlags.OK, HitFlags.DOUBLE_HIT
    >>> [flags.words for flags in decide_flags(faults, [HitDecision(2, "accept", ("double-hit",))])]
    ['good', 'good']
    """
    by_hit, hits = {decision.hit: decision for decision in decisions}, enumerate(faults, 1)
    return tuple(by_hit[hit].apply(found) if hit in by_hit else found for hit, found in hits)


@dataclass(frozen=True, eq=False)
class TapTest:
    """Finished tap test."""

    id: str
    """UTC time to the microsecond, machine, tool, direction and four random hex digits."""
    circumstances: Circumstances
    """Operator, machine, tool, direction and time."""
    frf: Frf | None
    """Averaged FRF; None if no force was measured."""
    hits: tuple[Hit, ...] = ()
    """All hits, also the rejected ones; empty for a recorded FRF."""
    flags: tuple[HitFlags, ...] = ()
    """Faults of each hit."""
    source: SourceFile | None = None
    """File that a replayed test was read from."""
    decisions: tuple[HitDecision, ...] = ()
    """Decisions of a person on hits, at most one per hit; of a tap file, those behind its FRF."""

    @property
    def decided_flags(self) -> tuple[HitFlags, ...]:
        """Flags of each hit after the decisions; falsy for an averaged hit."""
        return decide_flags(self.flags, self.decisions)

    @property
    def required_frf(self) -> Frf:
        """Averaged FRF; DataError where no force was measured."""
        if self.frf is None:
            raise DataError(f"{self.id}: no FRF, because no force was measured. Tap with an instrumented hammer.")
        return self.frf

    @property
    def accepted(self) -> tuple[Hit, ...]:
        """Hits that were averaged."""
        return tuple(hit for hit, flags in zip(self.hits, self.decided_flags, strict=True) if not flags)


def new_tap_id(circumstances: Circumstances) -> str:
    """Make an identifier that sorts by time and is a valid file name on every system.

    Parameters
    ----------
    circumstances
        Time, machine, tool and direction of the test.

    Returns
    -------
    str
        Identifier; it ends with four random digits.

    Raises
    ------
    ValueError
        For a machine, tool or operator with control characters in the name.

    Examples
    --------
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
    """Return a name as it appears in identifiers.

    Parameters
    ----------
    name
        Name of a machine or a tool.

    Returns
    -------
    str
        Letters, digits and hyphens, at most 24; empty if nothing remains.

    Examples
    --------
    >>> sanitize_id_part("Mill 3 / old"), sanitize_id_part("Fräse")
    ('Mill-3-old', 'Fr-se')
    """
    return re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-")[:24]


def parse_machine_name(tap_id: str) -> str:
    """Return the name of the machine in an identifier.

    Parameters
    ----------
    tap_id
        Identifier of a tap test.

    Returns
    -------
    str
        Name as `sanitize_id_part` gives it; empty if the text is no identifier.

    Examples
    --------
    >>> parse_machine_name("20260302T093000.000000Z_Mill-3_D16_x_1a2b"), parse_machine_name("hit.lvm")
    ('Mill-3', '')
    """
    return tap_id.split("_")[1] if re.match(r"\d{8}T\d{6}\.\d{6}Z_", tap_id) else ""
