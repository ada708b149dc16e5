"""Compare recorded cuts with the prediction of the tap tests, and store them in the journal."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Literal

import numpy as np

from acquisition import DataError
from acquisition.files.cut_file import CutSignal
from lobewatch.cuts.chatter_detection.cut_evaluation import CutEvaluation, CutRecording, evaluate_recording
from lobewatch.cuts.chatter_detection.earlier_air import evaluate_with_air
from lobewatch.cuts.chatter_detection.spectrum import sideband_distance
from lobewatch.cuts.chatter_detection.without_air import AIR_REASONS, evaluate_without_air
from lobewatch.cuts.learning.cut_likelihood import ExpectedChatter, predict_chatter
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.logbook import Logbook
from lobewatch.logbook.remembered_air import find_remembered_air
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_updates import lobewatch_version, resolve_cutting_time, store_cut
from lobewatch.machine.journal.entries import CutEntry, CutVerdict
from lobewatch.machine.settings.drive_power import CutPower
from lobewatch.machine.settings.requested_cut import CutSetting
from lobewatch.tool.assembly import Assembly

CutSensor = Literal["accelerometer", "microphone"]
"""Sensor that records cuts."""


@dataclass(frozen=True, eq=False)
class CutComparison:
    """Detected chatter of a recorded cut, compared with the prediction of the tap tests."""

    setting: CutSetting
    """Speed, depth and tool of the cut."""
    detected: CutEvaluation
    """Evaluation of the recording."""
    assembly: Assembly | None
    """Assembly of the tool. None if it was not tapped and cannot be predicted."""
    sensor: CutSensor
    """Sensor that recorded the cut."""
    predicted: ExpectedChatter | None
    """Chatter predicted from the modes at the detected speed, else at the set speed. None without modes."""
    air_from: str = ""
    """Identity of the earlier cut whose air was used; empty with air of its own."""

    @property
    def tooth_passing_frequency(self) -> float:
        """Tooth passing frequency (Hz)."""
        return self.setting.cut.repeats_per_turn * self.speed_rpm / 60

    @property
    def speed_rpm(self) -> float:
        """Detected spindle speed, else the set speed (rpm)."""
        return self.detected.speed_rpm if np.isfinite(self.detected.speed_rpm) else self.setting.speed_rpm

    @property
    def power(self) -> CutPower | None:
        """Drive power of the cut at this speed, or None."""
        return None if self.setting.power is None else self.setting.power.at(self.speed_rpm)

    @property
    def lobe_number(self) -> int | None:
        """Number of whole chatter waves between two teeth. None without chatter."""
        chatter = self.detected.chatter
        return None if chatter is None else int(chatter.frequency * 60 / (self.setting.cut.teeth * self.speed_rpm))

    @property
    def frequency_difference(self) -> float | None:
        """Detected less predicted chatter frequency, modulo tooth passing (Hz). None without both."""
        chatter, predicted = self.detected.chatter, self.predicted
        if chatter is None or predicted is None:
            return None
        return float(sideband_distance(predicted.frequency, chatter.frequency, self.tooth_passing_frequency))

    def nearest_mode_frequency(self, frequency: float) -> float | None:
        """Return the frequency (Hz) of the tapped mode nearest to a frequency, or None without modes."""
        tapped = () if self.assembly is None else (*(self.assembly.x or ()), *(self.assembly.y or ()))
        return min((mode.frequency for mode in tapped), key=lambda mode: abs(mode - frequency), default=None)

    def to_recorded_cut(self, at: datetime, begin: float = 0.0, upload: str = "") -> CutEntry:
        """Make the journal entry of a cut made at a time (UTC); begin: of its part of the recording (s).

        upload: SHA-256 of the file that a phone sent.
        """
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
            parts=tuple(part.shift(-begin) for part in self.detected.part_verdicts),
            upload=upload,
        )


SEVERITIES: tuple[CutVerdict, ...] = ("stable", "cannot tell", "flip", "chatter")
"""Verdicts from best to worst."""


def find_worst_cut(comparisons: Sequence[CutComparison]) -> CutComparison:
    """Return the first of the worst cuts in a recording, whose verdict is that of the recording.

    Parameters
    ----------
    comparisons
        Cuts in the recording, at least one.
    """
    return max(comparisons, key=lambda cut: SEVERITIES.index(cut.detected.verdict))


def compare_cuts(logbook: Logbook, setting: CutSetting, signal: CutSignal) -> list[CutComparison]:
    """Evaluate each cut in a recording and predict its chatter."""
    as_set = setting.cut.repeats_per_turn, setting.cut.immersion, setting.speed_rpm
    found = signal.clipped, signal.lost_scans, signal.speed_rpm
    tool = logbook.query(Analysis.assembly_or_reason, setting.tool)
    assembly = None if isinstance(tool, DataError) or not tool.directions else tool
    modes = () if assembly is None else (*(assembly.x or ()), *(assembly.y or ()))
    lowest = min((mode.frequency for mode in modes), default=0.0)
    recording = CutRecording(signal.acceleration, signal.sample_rate, *as_set, *found, lowest)
    sensor: CutSensor = "microphone" if signal.sensor == "microphone" else "accelerometer"
    evaluated, air_from = _evaluate_with_any_air(logbook, setting, signal, recording)
    if isinstance(tool, DataError) and not air_from:
        evaluated = evaluate_without_air(recording, evaluated)
    comparisons = [CutComparison(setting, detected, assembly, sensor, None, air_from) for detected in evaluated]
    if assembly is None:
        return comparisons
    return [replace(cut, predicted=predict_chatter(setting, assembly, cut.speed_rpm)) for cut in comparisons]


def _evaluate_with_any_air(
    logbook: Logbook, setting: CutSetting, signal: CutSignal, recording: CutRecording
) -> tuple[list[CutEvaluation], str]:
    """Evaluate each cut; without air in the recording with that of an earlier cut, whose identity is returned."""
    evaluated = evaluate_recording(recording)
    if any(detected.reason not in AIR_REASONS for detected in evaluated):
        return evaluated, ""
    air = find_remembered_air(logbook, setting, signal)
    if air is None:
        return evaluated, ""
    again = evaluate_with_air(recording, air.signal, is_calibrated=signal.sensor != "microphone")
    if any(detected.reason in AIR_REASONS for detected in again):
        return evaluated, ""
    return again, air.cut


def store_recorded_cuts(
    folder: MachineFolder,
    comparisons: Sequence[CutComparison],
    signal: CutSignal,
    at: datetime | None,
    upload: str = "",
    kept: Sequence[CutEntry] = (),
) -> list[CutEntry]:
    """Store each cut with its part of the recording, and return the entries of all.

    `at` is the time of the cut, None for now. upload: SHA-256 of the file that a phone sent; kept: first cuts of that
    file that are in the journal already.
    """
    time = kept[0].at if kept else resolve_cutting_time(at, datetime.now(UTC))
    parts = [comparison.detected.parts for comparison in comparisons]
    begins, ends = [0.0, *(part.end for part in parts[:-1])], [*(part.begin for part in parts[1:]), signal.duration]
    left = list(zip(comparisons, begins, ends, strict=True))[len(kept) :]
    return [
        *kept,
        *(
            store_cut(folder, comparison.to_recorded_cut(time, begin, upload), signal.slice_time(begin, end))
            for comparison, begin, end in left
        ),
    ]
