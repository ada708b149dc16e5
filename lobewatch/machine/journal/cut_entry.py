"""Journal lines for test cuts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from typing import Any, Literal, get_args

from lobes import Cut
from lobewatch.machine.settings.drive_power import CutPower

CutVerdict = Literal["stable", "chatter", "flip", "cannot tell"]
"""Word on the sound of a cut; flip: chatter whose period is two teeth."""
CUT_LINE_KIND = "cut"
"""Kind of its line in the journal."""


@dataclass(frozen=True)
class RecordingFile:
    """File of a recording, as the journal vouches for it."""

    id: str
    """Identity of the cut."""
    sha256: str
    """SHA-256 of the file."""
    size: int
    """Size of the file (bytes)."""

    @property
    def file(self) -> str:
        """Place of the file in the folder of the machine."""
        return f"cuts/{self.id}.h5"


@dataclass(frozen=True)
class CutEntry:
    """A test cut, as it was cut and heard; what it was cut with stands here as it was then, whatever becomes of it."""

    id: str
    """Number in the journal, "c1" on."""
    at: datetime
    """Time at which it was cut (UTC)."""
    program: str | None
    """Cutting program that it was a cut of; None for the reference cut."""
    tool: str
    """Tool in the spindle."""
    cut: Cut
    """Teeth and their pitch, immersion, direction and the coefficients that it was judged with."""
    coefficients: str
    """Material that these are of; empty where machine.toml gave the numbers themselves."""
    feed: str
    """Axis of the machine that it was fed along, "x" or "y"; "both" where that is not known."""
    feed_per_tooth: float | None
    """Feed per tooth (m); None where machine.toml does not say."""
    commanded_rpm: float
    """Spindle speed as it was set (rpm)."""
    speed_rpm: float
    """Spindle speed as it was heard (rpm); as it was set where that was by ear."""
    depth: float
    """Axial depth of cut (m)."""
    word: CutVerdict
    """Word on its sound."""
    chatter_frequency_hz: float | None
    """Chatter frequency (Hz); None where it was none, or nobody knows."""
    by: Literal["ear", "accelerometer", "microphone"]
    """Ear or instrument that heard it."""
    software: str
    """Version of lobewatch that wrote it down."""
    chatter_frequency_std_hz: float | None = None
    """Standard error of the chatter frequency (Hz); None where nobody knows."""
    reason: str = ""
    """Code of the reason why the word cannot be told; empty where it can."""
    recording: RecordingFile | None = None
    """Recording of its sound; None for what was heard by ear."""
    power: CutPower | None = None
    """Power of the cut; None where nobody has read it."""
    excluded: str = ""
    """Reason why a person has taken it out; empty where it counts; lines of their own."""

    def __post_init__(self) -> None:
        """Refuse a word that is none."""
        if self.word not in get_args(CutVerdict):
            raise ValueError(f"word={self.word!r} is none of {', '.join(get_args(CutVerdict))}")

    @property
    def is_usable(self) -> bool:
        """Whether anything can be learnt from it."""
        return not self.excluded and self.word != "cannot tell"

    @property
    def has_chatter(self) -> bool:
        """Whether chatter was heard, of either kind."""
        return self.word in ("chatter", "flip")

    @property
    def line(self) -> dict[str, Any]:
        """Line of the journal."""
        fields = {name: value for name, value in asdict(self).items() if name != "excluded"}
        return {"kind": CUT_LINE_KIND, **fields, "at": self.at.isoformat()}


def geometry_key(cut: Cut) -> tuple[int, float, str, float, tuple[float, ...]]:
    """Properties that two cuts with one cutter at one immersion have alike, whatever the material and the feed."""
    return cut.teeth, cut.immersion, cut.direction, cut.helix_lag, cut.pitch


def parse_cut_line(line: Mapping[str, Any], excluded: str = "") -> CutEntry:
    """Test cut of the line that `CutEntry.line` has made."""
    fields = {name: line[name] for name in CutEntry.__dataclass_fields__ if name in line}
    fields |= {"at": datetime.fromisoformat(line["at"]).astimezone(UTC), "cut": Cut(**line["cut"])}
    recording, power = line.get("recording"), line.get("power")
    fields |= {"recording": RecordingFile(**recording) if recording else None}
    fields |= {"power": CutPower(**power) if power else None}
    return CutEntry(**fields | {"excluded": excluded})


def read_cuts(entries: Sequence[Mapping[str, Any]], excluded: Mapping[str, str]) -> tuple[CutEntry, ...]:
    """Test cuts of a journal, oldest first by their time; excluded: reasons why some are, by identity."""
    lines = {line["id"]: line for line in entries if line["kind"] == CUT_LINE_KIND}
    cuts = [parse_cut_line(line, excluded.get(name, "")) for name, line in lines.items()]
    return tuple(sorted(cuts, key=lambda cut: cut.at))
