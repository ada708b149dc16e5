"""Journal lines for test cuts, events and exclusions, and the tests and cuts that all lines give."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from operator import attrgetter
from typing import Any, Literal, get_args

import msgspec

from acquisition import HitDecision
from acquisition.hit_quality.decide_hits import merge_decisions
from lobes import Cut
from lobewatch.machine.journal.journal import JournalEntry, JournalReading, make_entry
from lobewatch.machine.journal.mass_checks import MASS_CHECK_KIND, MassCheckEntry
from lobewatch.machine.journal.tap_entry import FIELDS_OF_OTHER_LINES, NO_MODE_EDITS, TapEntry, decode_tap_entries
from lobewatch.machine.settings.drive_power import CutPower
from modal import ModeEdits

CutVerdict = Literal["stable", "chatter", "flip", "cannot tell"]
"""Result of a test cut; flip: chatter with the period of two teeth."""
CUT_LINE_KIND = "cut"
"""Kind of its journal line."""
POWER_READING = "power-reading"
"""Reason of "cannot tell" of a power of normal production, which has no verdict."""


@dataclass(frozen=True)
class RecordingFile:
    """File of a recorded cut, as committed to the journal."""

    id: str
    """Identity of the cut."""
    sha256: str
    """SHA-256 of the file."""
    size: int
    """Size of the file (bytes)."""

    @property
    def file(self) -> str:
        """Path of the file in the machine folder."""
        return f"cuts/{self.id}.h5"


@dataclass(frozen=True)
class PartVerdict:
    """Verdict on a part of a cut."""

    from_s: float
    """Time at which the part begins, from the beginning of the recording (s)."""
    to_s: float
    """Time at which it ends (s)."""
    verdict: CutVerdict
    """Verdict on the part."""
    hz: float | None = None
    """Chatter frequency (Hz); None without chatter."""

    def shift(self, seconds: float) -> "PartVerdict":
        """Return the part in a recording that begins some seconds earlier."""
        return replace(self, from_s=round(self.from_s + seconds, 3), to_s=round(self.to_s + seconds, 3))


@dataclass(frozen=True)
class CutEntry:
    """Test cut with its result; the settings are those at the time of the cut."""

    id: str
    """Identity in the journal, "c1" on."""
    at: datetime
    """Time of the cut (UTC)."""
    program: str | None
    """Name of the program; None for the reference cut."""
    tool: str
    """Tool in the spindle."""
    cut: Cut
    """Teeth, pitch, immersion, direction and cutting coefficients."""
    coefficients: str
    """Material of the coefficients; empty if machine.toml gave the numbers."""
    feed: str
    """Axis of the feed, "x" or "y"; "both" if unknown."""
    feed_per_tooth: float | None
    """Feed per tooth (m); None if unknown."""
    commanded_rpm: float
    """Commanded spindle speed (rpm)."""
    speed_rpm: float
    """Detected spindle speed (rpm); the commanded one without a recording."""
    depth: float
    """Axial depth of cut ap (m)."""
    word: CutVerdict
    """Result of the cut."""
    chatter_frequency_hz: float | None
    """Chatter frequency (Hz); None without chatter or if unknown."""
    by: Literal["ear", "accelerometer", "microphone", "display"]
    """Ear or instrument that detected the result; "display" of the drive for a power without a verdict."""
    software: str
    """Version of lobewatch that wrote the line."""
    chatter_frequency_std_hz: float | None = None
    """Standard error of the chatter frequency (Hz); None if unknown."""
    reason: str = ""
    """Code of the reason of "cannot tell"; empty otherwise."""
    recording: RecordingFile | None = None
    """Recording of the cut; None without one."""
    power: CutPower | None = None
    """Power of the cut; None if it was not read."""
    parts: tuple[PartVerdict, ...] = ()
    """Verdicts on the parts of the cut, from the beginning of its recording; empty without them."""
    excluded: str = ""
    """Reason of its exclusion, from other lines; empty if included."""

    def __post_init__(self) -> None:
        if self.word not in get_args(CutVerdict):
            raise ValueError(f"word={self.word!r} is not one of {', '.join(get_args(CutVerdict))}")

    @property
    def is_usable(self) -> bool:
        """True if the verdict of the cut counts for learning."""
        return not self.excluded and self.word != "cannot tell"

    @property
    def is_power_reading(self) -> bool:
        """True for a power of normal production that counts for learning."""
        return not self.excluded and self.power is not None and self.reason == POWER_READING

    @property
    def is_evidence(self) -> bool:
        """True if verdict or power of the cut count for learning."""
        return self.is_usable or self.is_power_reading

    def with_tangential_by_power(self, tangential: float) -> "CutEntry":
        """Return the cut with another Kt by power (Pa)."""
        return self if self.power is None else replace(self, power=replace(self.power, tangential=tangential))

    @property
    def has_chatter(self) -> bool:
        """True if chatter of any kind was detected."""
        return self.word in ("chatter", "flip")

    @property
    def line(self) -> dict[str, Any]:
        """Journal line."""
        fields = {name: value for name, value in asdict(self).items() if name != "excluded"}
        del fields["cut"]["process_damping"]
        if not self.parts:
            del fields["parts"]
        return {"kind": CUT_LINE_KIND, **fields, "at": self.at.isoformat()}


def list_decisive_cuts(cuts: Sequence[CutEntry]) -> list[CutEntry]:
    """List the usable cuts without stable ones whose recording has another verdict, in a part or in another pass.

    Parameters
    ----------
    cuts
        Cuts of the journal, oldest first.
    """
    worse = {_recording_key(cut) for cut in cuts if not cut.excluded and cut.by != "ear" and cut.word != "stable"}
    return [cut for cut in cuts if cut.is_usable and (cut.has_chatter or _is_stable_throughout(cut, worse))]


def _recording_key(cut: CutEntry) -> tuple[datetime, str, float, float]:
    """Return the facts that all passes of a recording share."""
    return cut.at, cut.by, cut.commanded_rpm, cut.depth


def _is_stable_throughout(cut: CutEntry, worse: set[tuple[datetime, str, float, float]]) -> bool:
    return _recording_key(cut) not in worse and all(part.verdict == "stable" for part in cut.parts)


def geometry_key(cut: Cut) -> tuple[int, float, str, float, tuple[float, ...]]:
    """Return the properties that cuts with the same cutter and immersion share."""
    return cut.teeth, cut.immersion, cut.direction, cut.helix_lag, cut.pitch


def material_key(material: str, cut: Cut) -> str | tuple[float, float]:
    """Return what cuts of one material share: its name, or its coefficients if it has none."""
    return material or (cut.tangential, cut.radial)


def parse_cut_line(line: Mapping[str, Any], excluded: str = "") -> CutEntry:
    """Read a test cut from its journal line."""
    fields = {name: line[name] for name in CutEntry.__dataclass_fields__ if name in line}
    fields |= {"at": datetime.fromisoformat(line["at"]).astimezone(UTC), "cut": Cut(**line["cut"])}
    for name, kind in (("recording", RecordingFile), ("power", CutPower)):
        fields[name] = kind(**line[name]) if line.get(name) else None
    fields["parts"] = tuple(PartVerdict(**part) for part in line.get("parts", ()))
    return CutEntry(**fields | {"excluded": excluded})


@dataclass(frozen=True)
class MaintenanceEvent:
    """Maintenance of the machine."""

    id: str
    """Identity in the journal, "e1" on."""
    time: datetime
    """Time of the maintenance (UTC)."""
    text: str
    """Description of the work."""
    new_baseline: bool
    """True if later tap tests are compared with none before it."""


def read_events(entries: Sequence[Mapping[str, Any]]) -> tuple[MaintenanceEvent, ...]:
    """Read the events of a journal that are not withdrawn, oldest first."""
    events: dict[str, MaintenanceEvent] = {}
    for line in entries:
        if line["kind"] == "event" and "withdraws" in line:
            events.pop(line["withdraws"], None)
        elif line["kind"] == "event":
            time = datetime.fromisoformat(line["date"])
            events[line["id"]] = MaintenanceEvent(line["id"], time, line["text"], line["new_baseline"])
    return tuple(sorted(events.values(), key=lambda event: event.time))


ExcludableEntry = TapEntry | CutEntry | MassCheckEntry
"""Entry that can be excluded."""


def find_excludable_entry(
    name: str, taps: Sequence[TapEntry], others: Sequence[CutEntry | MassCheckEntry], path: str
) -> ExcludableEntry:
    """Find the test cut or mass check of an identity, or the tap test of an identity, a part of it, or a file.

    Raises ValueError if there is none or there are several.
    """
    for other in others:
        if other.id == name:
            return other
    part = name.replace("\\", "/").rpartition("/")[2].removesuffix(".h5")
    matches = [tap for tap in taps if tap.id == part] or [tap for tap in taps if part and part in tap.id]
    if len(matches) == 1:
        return matches[0]
    if matches:
        examples = f"({matches[0].id}, {matches[1].id}, ...)"
        raise ValueError(f"{name!r} matches {len(matches)} tap tests {examples}. Give the whole name of the tap test.")
    raise ValueError(
        f"no tap test {name!r} in {path}. Run MachineFolder.contents {path} to list all {len(taps)} tap tests."
    )


def read_exclusion_reasons(entries: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Read the reasons of all exclusions, by identity."""
    reasons: dict[str, str] = {}
    for line in entries:
        if line["kind"] == "exclude":
            reasons[line["tap"]] = line["reason"]
        elif line["kind"] == "include":
            reasons.pop(line["tap"], None)
    return reasons


HIT_LINE_KIND = "hit"
"""Kind of the journal line of a decision on a hit."""


def make_hit_entries(tap_id: str, decisions: Iterable[HitDecision]) -> list[JournalEntry]:
    """Make the journal entries of decisions on the hits of a tap test."""
    return [make_entry(HIT_LINE_KIND, tap=tap_id, **asdict(decision)) for decision in decisions]


def read_hit_decisions(entries: Sequence[Mapping[str, Any]]) -> dict[str, tuple[HitDecision, ...]]:
    """Read the decisions on hits that count, by tap test; it may still be in progress."""
    decisions: dict[str, list[HitDecision]] = {}
    for line in (line for line in entries if line["kind"] == HIT_LINE_KIND):
        decisions.setdefault(line["tap"], []).append(msgspec.convert(line, HitDecision))
    return {tap_id: merge_decisions(made) for tap_id, made in decisions.items()}


def read_committed_cuts(reading: JournalReading) -> tuple[CutEntry, ...]:
    """Read the test cuts of the journal, oldest first."""
    excluded = read_exclusion_reasons(reading.other_entries)
    lines = {line["id"]: line for line in reading.other_entries if line["kind"] == CUT_LINE_KIND}
    cuts = [parse_cut_line(line, excluded.get(name, "")) for name, line in lines.items()]
    return tuple(sorted(cuts, key=attrgetter("at")))


def read_committed_taps(reading: JournalReading) -> dict[str, TapEntry]:
    """Read the tap tests of the journal by identity."""
    accepted, lines = dict[str, tuple[str, ...]](), reading.other_entries
    for line in lines:
        if line["kind"] == "accept":
            accepted[line["tap"]] = (*accepted.get(line["tap"], ()), line["code"])
    excluded = read_exclusion_reasons(lines)
    by_hand = {line["tap"]: msgspec.convert(line, ModeEdits) for line in lines if line["kind"] == "modes"}
    hits = read_hit_decisions(lines)
    old = (TapEntry.from_line(line) for line in lines if line["kind"] == "tap")
    entries = {entry.id: entry for entry in (*decode_tap_entries(reading.lines), *old)}
    for name in entries.keys() & (accepted.keys() | excluded.keys() | by_hand.keys() | hits.keys()):
        later = accepted.get(name, ()), excluded.get(name, ""), by_hand.get(name, NO_MODE_EDITS), hits.get(name, ())
        changes = dict(zip(FIELDS_OF_OTHER_LINES, later, strict=True))
        entries[name] = msgspec.structs.replace(entries[name], **changes)
    return entries


def read_mass_checks(entries: Sequence[Mapping[str, Any]]) -> tuple[MassCheckEntry, ...]:
    """Read the checks with a known mass, oldest first."""
    excluded = read_exclusion_reasons(entries)
    lines = [line for line in entries if line["kind"] == MASS_CHECK_KIND]
    checks = [msgspec.convert({**line, "excluded": excluded.get(line["id"], "")}, MassCheckEntry) for line in lines]
    return tuple(sorted(checks, key=attrgetter("date")))


def read_given_up_ids(reading: JournalReading) -> set[str]:
    """Return the identities of lost tap tests and recordings."""
    return {line["tap"] for line in reading.other_entries if line["kind"] == "lost"}
