"""Journal lines for test cuts."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from typing import Any, Literal, get_args

from lobes import Cut
from lobewatch.machine.settings.drive_power import CutPower

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
    upload: str = ""
    """SHA-256 of the file from which a phone's page stored the cut; empty for other cuts."""
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
        for name in ("parts", "upload"):
            if not fields[name]:
                del fields[name]
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
    """Return the key of a material: its name, or its coefficients if it has none."""
    return material or (cut.tangential, cut.radial)


def parse_cut_line(line: Mapping[str, Any], excluded: str = "") -> CutEntry:
    """Read a test cut from its journal line."""
    fields = {name: line[name] for name in CutEntry.__dataclass_fields__ if name in line}
    fields |= {"at": datetime.fromisoformat(line["at"]).astimezone(UTC), "cut": Cut(**line["cut"])}
    for name, kind in (("recording", RecordingFile), ("power", CutPower)):
        fields[name] = kind(**line[name]) if line.get(name) else None
    fields["parts"] = tuple(PartVerdict(**part) for part in line.get("parts", ()))
    return CutEntry(**fields | {"excluded": excluded})
