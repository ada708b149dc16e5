"""A recording of a cut of a machine, listened to: what is written down of it, and what was to be expected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Literal

import numpy as np

from acquisition import DataError
from acquisition.files.cut_file import CutSignal
from lobewatch.cuts.listening.expected_sound import ExpectedSound, expected_sound
from lobewatch.cuts.listening.fold_frequency import family_distance
from lobewatch.cuts.listening.judge_cut import HeardSound
from lobewatch.cuts.listening.listen_to import CutRecording, listen_to
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine.additions.keep_cut import keep_cut, software
from lobewatch.machine.additions.observe_cut import cutting_time
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.journal.heard_cut import HeardCut
from lobewatch.machine.settings.cut_power import CutPower
from lobewatch.machine.settings.cut_setting import CutSetting
from lobewatch.tool.assembly import Assembly

Sensor = Literal["accelerometer", "microphone"]
"""What hears cuts."""


@dataclass(frozen=True, eq=False)
class CutComparison:
    """What was heard beside what the tap tests predict."""

    setting: CutSetting
    """Setting that was cut with."""
    heard: HeardSound
    """Sound of the cut."""
    assembly: Assembly | None
    """The tool as it was tapped; None where it was not and cannot be predicted."""
    sensor: Sensor
    """What heard it."""
    predicted: ExpectedSound | None
    """Sound by its modes, at the speed that was heard (that was set where none was); None without them."""

    @property
    def tooth_frequency(self) -> float:
        """Times a second that the cut repeats, at the speed that was heard, else as it was set (Hz)."""
        return self.setting.cut.repeats * self.speed_rpm / 60

    @property
    def speed_rpm(self) -> float:
        """As it was heard; as it was set where it was not."""
        return self.heard.speed_rpm if np.isfinite(self.heard.speed_rpm) else self.setting.speed_rpm

    @property
    def power(self) -> CutPower | None:
        """Power of the cut at that speed; None where nobody has read it."""
        return None if self.setting.power is None else self.setting.power.at(self.speed_rpm)

    @property
    def lobe(self) -> int | None:
        """Whole waves of chatter between two teeth; None without chatter."""
        chatter = self.heard.chatter
        return None if chatter is None else int(chatter.frequency * 60 / (self.setting.cut.teeth * self.speed_rpm))

    @property
    def apart(self) -> float | None:
        """Chatter heard from chatter predicted, modulo tooth passing (Hz); None where one of them is not known."""
        if self.heard.chatter is None or self.predicted is None:
            return None
        return float(family_distance(self.predicted.frequency, self.heard.chatter.frequency, self.tooth_frequency))

    def nearest_mode(self, frequency: float) -> float | None:
        """Frequency of the mode as tapped that is nearest to one (Hz); None where none was tapped."""
        tapped = () if self.assembly is None else (*(self.assembly.x or ()), *(self.assembly.y or ()))
        return min((mode.frequency for mode in tapped), key=lambda mode: abs(mode - frequency), default=None)

    def as_heard(self, at: datetime) -> HeardCut:
        """To be written down; at: when it was cut (UTC)."""
        chatter = self.heard.chatter
        return HeardCut(
            "",
            at,
            **self.setting.heard_cut_fields(self.speed_rpm),
            word=self.heard.word,
            chatter_frequency_hz=None if chatter is None else chatter.frequency,
            chatter_frequency_std_hz=None if chatter is None else chatter.error,
            by=self.sensor,
            software=software(),
            reason=self.heard.reason,
        )


def compare_cuts(logbook: Logbook, setting: CutSetting, signal: CutSignal) -> list[CutComparison]:
    """Listen to a recording; each cut in it by itself, one at least."""
    cut = setting.cut
    recording = CutRecording(
        signal.acceleration,
        signal.sample_rate,
        cut.repeats,
        cut.immersion,
        setting.speed_rpm,
        signal.clipped,
        signal.lost_scans,
        signal.speed_rpm,
    )
    tool = logbook.ask(Analysis.assembly_or_reason, setting.tool)
    assembly = None if isinstance(tool, DataError) or not tool.directions else tool
    sensor: Sensor = "microphone" if signal.sensor == "microphone" else "accelerometer"
    return [_compared(setting, heard, assembly, sensor) for heard in listen_to(recording)]


def _compared(setting: CutSetting, heard: HeardSound, assembly: Assembly | None, sensor: Sensor) -> CutComparison:
    speed = heard.speed_rpm if np.isfinite(heard.speed_rpm) else setting.speed_rpm
    expected = None if assembly is None else expected_sound(setting, assembly, speed)
    return CutComparison(setting, heard, assembly, sensor, expected)


def keep_listened(
    folder: MachineFolder, comparisons: Sequence[CutComparison], signal: CutSignal, at: datetime | None
) -> list[HeardCut]:
    """Write down what was heard, each cut with what was recorded between those beside it. Saved when this returns.

    at: when it was cut, None for now.
    """
    time = cutting_time(at, datetime.now(UTC))
    begins, ends = [[getattr(one.heard.parts, name) for one in comparisons] for name in ("begin", "end")]
    sounds = zip([0.0, *ends[:-1]], [*begins[1:], signal.seconds], strict=True)
    return [
        keep_cut(folder, comparison.as_heard(time), signal.part(*sound))
        for comparison, sound in zip(comparisons, sounds, strict=True)
    ]
