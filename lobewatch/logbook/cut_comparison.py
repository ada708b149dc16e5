"""A recording of a cut of a machine, listened to: what is written down of it, and what was to be expected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Literal

import numpy as np

from acquisition import DataError
from acquisition.files.cut_file import CutSignal
from lobewatch.cuts.chatter_detection.cut_evaluation import CutEvaluation, CutRecording, evaluate_recording
from lobewatch.cuts.chatter_detection.spectrum import sideband_distance
from lobewatch.cuts.learning.cut_likelihood import ExpectedChatter, predict_chatter
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_updates import lobewatch_version, resolve_cutting_time, store_cut
from lobewatch.machine.journal.cut_entry import CutEntry
from lobewatch.machine.settings.drive_power import CutPower
from lobewatch.machine.settings.requested_cut import CutSetting
from lobewatch.tool.assembly import Assembly

CutSensor = Literal["accelerometer", "microphone"]
"""What hears cuts."""


@dataclass(frozen=True, eq=False)
class CutComparison:
    """What was heard beside what the tap tests predict."""

    setting: CutSetting
    """Setting that was cut with."""
    detected: CutEvaluation
    """Sound of the cut."""
    assembly: Assembly | None
    """The tool as it was tapped; None where it was not and cannot be predicted."""
    sensor: CutSensor
    """What heard it."""
    predicted: ExpectedChatter | None
    """Sound by its modes, at the speed that was heard (that was set where none was); None without them."""

    @property
    def tooth_passing_frequency(self) -> float:
        """Times a second that the cut repeats, at the speed that was heard, else as it was set (Hz)."""
        return self.setting.cut.repeats_per_turn * self.speed_rpm / 60

    @property
    def speed_rpm(self) -> float:
        """As it was heard; as it was set where it was not."""
        return self.detected.speed_rpm if np.isfinite(self.detected.speed_rpm) else self.setting.speed_rpm

    @property
    def power(self) -> CutPower | None:
        """Power of the cut at that speed; None where nobody has read it."""
        return None if self.setting.power is None else self.setting.power.at(self.speed_rpm)

    @property
    def lobe_number(self) -> int | None:
        """Whole waves of chatter between two teeth; None without chatter."""
        chatter = self.detected.chatter
        return None if chatter is None else int(chatter.frequency * 60 / (self.setting.cut.teeth * self.speed_rpm))

    @property
    def frequency_difference(self) -> float | None:
        """Chatter heard from chatter predicted, modulo tooth passing (Hz); None where one of them is not known."""
        if self.detected.chatter is None or self.predicted is None:
            return None
        return float(
            sideband_distance(self.predicted.frequency, self.detected.chatter.frequency, self.tooth_passing_frequency)
        )

    def nearest_mode_frequency(self, frequency: float) -> float | None:
        """Frequency of the mode as tapped that is nearest to one (Hz); None where none was tapped."""
        tapped = () if self.assembly is None else (*(self.assembly.x or ()), *(self.assembly.y or ()))
        return min((mode.frequency for mode in tapped), key=lambda mode: abs(mode - frequency), default=None)

    def to_recorded_cut(self, at: datetime) -> CutEntry:
        """To be written down; at: when it was cut (UTC)."""
        chatter = self.detected.chatter
        return CutEntry(
            "",
            at,
            **self.setting.cut_entry_fields(self.speed_rpm),
            word=self.detected.verdict,
            chatter_frequency_hz=None if chatter is None else chatter.frequency,
            chatter_frequency_std_hz=None if chatter is None else chatter.error,
            by=self.sensor,
            software=lobewatch_version(),
            reason=self.detected.reason,
        )


def compare_cuts(logbook: Logbook, setting: CutSetting, signal: CutSignal) -> list[CutComparison]:
    """Listen to a recording; each cut in it by itself, one at least."""
    cut = setting.cut
    recording = CutRecording(
        signal.acceleration,
        signal.sample_rate,
        cut.repeats_per_turn,
        cut.immersion,
        setting.speed_rpm,
        signal.clipped,
        signal.lost_scans,
        signal.speed_rpm,
    )
    tool = logbook.query(Analysis.assembly_or_reason, setting.tool)
    assembly = None if isinstance(tool, DataError) or not tool.directions else tool
    sensor: CutSensor = "microphone" if signal.sensor == "microphone" else "accelerometer"
    return [_compare_cut(setting, heard, assembly, sensor) for heard in evaluate_recording(recording)]


def _compare_cut(
    setting: CutSetting, heard: CutEvaluation, assembly: Assembly | None, sensor: CutSensor
) -> CutComparison:
    speed = heard.speed_rpm if np.isfinite(heard.speed_rpm) else setting.speed_rpm
    expected = None if assembly is None else predict_chatter(setting, assembly, speed)
    return CutComparison(setting, heard, assembly, sensor, expected)


def store_recorded_cuts(
    folder: MachineFolder, comparisons: Sequence[CutComparison], signal: CutSignal, at: datetime | None
) -> list[CutEntry]:
    """Write down what was heard, each cut with what was recorded between those beside it. Saved when this returns.

    at: when it was cut, None for now.
    """
    time = resolve_cutting_time(at, datetime.now(UTC))
    begins, ends = [[getattr(one.detected.parts, name) for one in comparisons] for name in ("begin", "end")]
    sounds = zip([0.0, *ends[:-1]], [*begins[1:], signal.duration], strict=True)
    return [
        store_cut(folder, comparison.to_recorded_cut(time), signal.slice_time(*sound))
        for comparison, sound in zip(comparisons, sounds, strict=True)
    ]
