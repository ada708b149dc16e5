"""Cuts of a tool that nobody tapped: next speeds by their sound, from one file or from the journal."""

import math
from collections.abc import Iterable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from acquisition import DataError, Description
from acquisition.files.cut_file import CutSignal
from acquisition.files.read_cut import MICROPHONE_SENSOR, read_cut_recording
from lobes import Cut
from lobewatch.cuts.chatter_detection.cut_evaluation import CutRecording, evaluate_recording
from lobewatch.cuts.chatter_detection.without_air import evaluate_without_air
from lobewatch.cuts.learning.next_speed import HeardCut, NextSpeeds, suggest_speeds
from lobewatch.history.tap_measurements import NotTappedError
from lobewatch.logbook.analysis import Analysis
from lobewatch.logbook.cut_comparison import CutComparison, CutSensor
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine import CutTable
from lobewatch.machine.journal.entries import CutEntry, geometry_key, list_decisive_cuts, material_key
from lobewatch.machine.settings.drive_power import CutRange
from lobewatch.machine.settings.requested_cut import CutSetting

ASSUMED_RANGE = (0.5, 1.5)
"""Speed range over the speed of the cut, if nobody gives the range of the machine; chosen."""
UNKNOWN_IMMERSION = 1.0
"""Radial depth over diameter of a recording if it is unknown: a slot, for which the fewest lines are checked."""
ARBITRARY_DIAMETER_MM, ARBITRARY_FORCES = 10.0, (1e9, 3e8)
"""Tool diameter (mm), Kt and Kr (Pa) of a cut whose machine is unknown; no result depends on them."""


class CutFileRequest(NamedTuple):
    """Facts about a recorded cut of an unknown machine."""

    teeth: int | None
    """Number of flutes; None if not given."""
    speed_rpm: float | None
    """Set spindle speed (rpm); None if not given."""
    depth_mm: float | None = None
    """Axial depth of cut (mm); None if unknown."""
    range_rpm: tuple[float, float] | None = None
    """Slowest and fastest speed of the machine (rpm); None if unknown."""

    def check(self) -> tuple[int, float, float, tuple[float, float]]:
        """Return teeth, speed (rpm), depth (m, NaN if unknown) and speed range (rpm); ValueError for bad values."""
        if self.teeth is None or self.speed_rpm is None:
            missing = "CutFileRequest.teeth" if self.teeth is None else "CutFileRequest.speed_rpm"
            raise ValueError(f"{missing} is missing. Give this value, because a recording names no machine.")
        for name in ("teeth", "speed_rpm", "depth_mm"):
            value = getattr(self, name)
            if value is not None and not 0 < value < math.inf:
                raise ValueError(f"CutFileRequest.{name} {value:g} is not above 0. Give a value above 0.")
        depth = math.nan if self.depth_mm is None else self.depth_mm / 1e3
        return self.teeth, self.speed_rpm, depth, self._range_rpm(self.speed_rpm)

    def _range_rpm(self, speed_rpm: float) -> tuple[float, float]:
        if self.range_rpm is None:
            return ASSUMED_RANGE[0] * speed_rpm, ASSUMED_RANGE[1] * speed_rpm
        low, high = self.range_rpm
        if not low <= speed_rpm <= high:
            raise ValueError(
                f"CutFileRequest.speed_rpm {speed_rpm:g} is outside CutFileRequest.range_rpm {low:g}..{high:g}. "
                "Correct one of them."
            )
        return low, high


def hear_file(path: Path, description: Description, request: CutFileRequest) -> tuple[list[CutComparison], NextSpeeds]:
    """Evaluate a recorded cut of an unknown machine, and suggest the next speeds.

    Parameters
    ----------
    path
        Recording of any known format; no sensitivity is needed.
    description
        What the file does not state itself.
    request
        Flutes, speed, depth and speed range.
    """
    request.check()
    return hear_signal(_read_without_sensitivity(path, description), path.name, request)


def hear_signal(signal: CutSignal, name: str, request: CutFileRequest) -> tuple[list[CutComparison], NextSpeeds]:
    """Evaluate the signal of a cut of an unknown machine, and suggest the next speeds.

    Parameters
    ----------
    signal
        Signal of the cut.
    name
        Name of the recording.
    request
        Flutes, speed, depth and speed range.
    """
    teeth, speed_rpm, depth, range_rpm = request.check()
    recording = CutRecording(
        signal.acceleration,
        signal.sample_rate,
        teeth,
        UNKNOWN_IMMERSION,
        speed_rpm,
        signal.clipped,
        signal.lost_scans,
        signal.speed_rpm,
    )
    evaluations = evaluate_without_air(recording, evaluate_recording(recording))
    setting, now = _make_setting(name, teeth, speed_rpm, depth), datetime.now(UTC)
    sensor: CutSensor = "microphone" if signal.sensor == MICROPHONE_SENSOR else "accelerometer"
    comparisons = [CutComparison(setting, found, None, sensor, None) for found in evaluations]
    cuts = find_heard_cuts(setting, [comparison.to_recorded_cut(now) for comparison in comparisons], None)
    return comparisons, suggest_speeds(cuts, teeth, range_rpm)


def _read_without_sensitivity(path: Path, description: Description) -> CutSignal:
    """Read a recording as sound, whose values need no unit; as a motion if it states one."""
    try:
        return read_cut_recording(path, replace(description, sensor=MICROPHONE_SENSOR))
    except DataError as error:
        try:
            return read_cut_recording(path, replace(description, sensor="accelerometer"))
        except DataError:
            raise error from None


def _make_setting(name: str, teeth: int, speed_rpm: float, depth: float) -> CutSetting:
    """Make the setting of a cut whose machine is unknown, named after its file."""
    tangential, radial = ARBITRARY_FORCES
    size = ARBITRARY_DIAMETER_MM
    table = CutTable(teeth, size, size, "down", tangential_n_per_mm2=tangential / 1e6, radial_n_per_mm2=radial / 1e6)
    cut = Cut(teeth, UNKNOWN_IMMERSION, "down", tangential, radial)
    return CutSetting(table, "", name, "", cut, "both", speed_rpm, depth)


def find_heard_cuts(setting: CutSetting, cuts: Iterable[CutEntry], since: datetime | None) -> list[HeardCut]:
    """Find the usable cuts with the tool, material, engagement and feed axis of a setting, oldest first.

    Parameters
    ----------
    setting
        Setting that the cuts must share, except for speed and depth.
    cuts
        Cuts of the journal, oldest first.
    since
        Time of the newest baseline, before which cuts do not count; None without one.
    """
    wanted = setting.tool, geometry_key(setting.cut), material_key(setting.material, setting.cut), setting.feed

    def is_same(cut: CutEntry) -> bool:
        return (cut.tool, geometry_key(cut.cut), material_key(cut.coefficients, cut.cut), cut.feed) == wanted

    decisive = list_decisive_cuts([cut for cut in cuts if is_same(cut) and (since is None or cut.at >= since)])
    return [HeardCut(cut.speed_rpm, cut.word, cut.chatter_frequency_hz or math.nan, cut.depth) for cut in decisive]


def is_untapped(logbook: Logbook) -> bool:
    """Return whether a machine has no usable tap test since its baseline.

    Parameters
    ----------
    logbook
        Logbook of the machine.
    """
    try:
        return not logbook.newest_tap()
    except NotTappedError:
        return True


def is_tool_untapped(logbook: Logbook, tool: str) -> bool:
    """Return whether a tool has no usable tap test since the baseline, nor modes that another tool gives.

    Parameters
    ----------
    logbook
        Logbook of the machine.
    tool
        Name of the tool.
    """
    return isinstance(logbook.query(Analysis.assembly_or_reason, tool), NotTappedError)


def suggest_by_sound(logbook: Logbook, setting: CutSetting, cuts: Iterable[CutEntry]) -> NextSpeeds:
    """Suggest the next speeds for a tool that nobody tapped, from its cuts.

    Parameters
    ----------
    logbook
        Logbook of the machine.
    setting
        Setting of the cut.
    cuts
        Cuts of the machine, oldest first.
    """
    heard = find_heard_cuts(setting, cuts, logbook.files.baseline)
    reach = CutRange.of(logbook.machine, setting.table)
    if reach.low_rpm >= reach.high_rpm:
        return NextSpeeds("no-speed-in-range", (reach.low_rpm, reach.high_rpm))
    return suggest_speeds(heard, setting.cut.teeth, (reach.low_rpm, reach.high_rpm))
