"""Check of the sensors behind a tap test: its evidence, and the remark without any."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from pathlib import Path

from acquisition import Channel, Remark
from lobewatch.machine.journal.journal import format_command
from lobewatch.machine.journal.mass_checks import MassCheckEntry
from lobewatch.machine.settings.setup_tables import ChannelTable

CHAIN_CODE = "chain-not-checked"
"""Code of the remark on a tap test whose sensors nothing has checked."""


class ChainEvidence(StrEnum):
    """Evidence that force and acceleration have the right size; each excludes an error by a factor of 3."""

    MASS = "mass-check"
    """Known mass: excludes every error above 5 %."""
    MODEL = "model"
    """Stiffness K agrees with the calibrated spindle model, which follows the frequency only."""
    TOOL = "tool-geometry"
    """Compliance at the tip agrees with diameter, stick-out and material of the tool."""
    OTHER_TOOL = "other-tool"
    """Another tool, tapped within a day with the same chain, agrees with its model or geometry."""
    SENSOR_MODELS = "sensor-models"
    """Sensitivities agree with those printed for the sensor models; excludes no wrong range or amplifier."""
    EMULATOR = "emulator"
    """Emulated device that states the sensitivities of its signals."""


EVIDENCE_TEXTS = {
    ChainEvidence.MASS: "mass check",
    ChainEvidence.MODEL: "stiffness K agrees with the spindle model",
    ChainEvidence.TOOL: "compliance agrees with the geometry of the tool",
    ChainEvidence.OTHER_TOOL: "another tool agrees with its drawing",
    ChainEvidence.EMULATOR: "emulated device",
    ChainEvidence.SENSOR_MODELS: "sensitivities agree with the sensor models",
}
"""Words for each evidence."""


@dataclass(frozen=True)
class ChainCheck:
    """Check of the sensors behind one tap test."""

    tap_id: str
    """Identity of the tap test."""
    evidence: ChainEvidence | None = None
    """Evidence; None without any."""
    date: datetime | None = None
    """Time of the mass check, or of the tap test that is the evidence; None without evidence."""
    remark: Remark | None = None
    """Remark without evidence."""
    is_recorded: bool = True
    """False for an older or replayed tap test, whose chain is unknown: then the remark limits no verdict."""

    @property
    def text(self) -> str:
        """Check in a few words."""
        if self.evidence is None or self.date is None:
            return "not checked" if self.remark is None else self.remark.text
        return f"{EVIDENCE_TEXTS[self.evidence]} ({self.date.astimezone():%Y-%m-%d})"


def find_weakest_check(checks: Sequence[ChainCheck]) -> ChainCheck | None:
    """Return the check on which a verdict rests: one without evidence, else the oldest; None without any."""
    by_date = sorted(checks, key=lambda check: 0.0 if check.date is None else check.date.timestamp())
    return next(iter(by_date), None)


def not_recorded_remark(tool: str) -> Remark:
    """Return the remark on older or replayed tap tests."""
    text = "sensor chain not checked, because older and replayed tap tests do not record it"
    return Remark(CHAIN_CODE, tool, text, "Check both sensors with a known mass, and tap again")


def format_check_command(path: Path | str, direction: str, inputs: Sequence[Channel | ChannelTable]) -> str:
    """Return the command of a mass check; it names the direction if the inputs have several accelerometers."""
    command = f"{format_command('sensors', Path(path))} check_mass.mass KG"
    is_one = sum(sensor.quantity == "acceleration" for sensor in inputs) < 2
    return command if is_one else f"{command} check_mass.direction {direction[-1:] or 'x'}"


def unchecked_remark(
    direction: str, path: Path | str, command: str, failed: MassCheckEntry | None, others: Sequence[MassCheckEntry]
) -> Remark:
    """Return the remark on a tap test without evidence.

    command: of a mass check; failed: failed mass check that decides on it; others: mass checks, oldest first, of other
    chains if none failed.
    """
    text, cure = "sensor chain not checked", f"Check both sensors with a known mass in two minutes: {command}"
    if failed is not None:
        text = f"mass check of {failed.date.astimezone():%Y-%m-%d} failed: ratio {failed.ratio:.3g}"
        exclude = f'{format_command("exclude", Path(path))} {failed.id} exclude_entry.reason "wrong mass"'
        cure = f"Correct the sensitivities and tap again. If only the mass was wrong, run {exclude}"
    elif others:
        date = f"{others[-1].date.astimezone():%Y-%m-%d}"
        text += f", because DAQ, sensitivity or range is not that of the mass check of {date}"
    return Remark(CHAIN_CODE, f"direction {direction}", text, cure)
