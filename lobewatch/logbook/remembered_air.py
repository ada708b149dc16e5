"""Air of earlier recorded cuts of a machine, for a cut recorded without air."""

from typing import NamedTuple

import numpy as np

from acquisition import DataError
from acquisition.files.cut_file import CutSignal, read_cut_signal
from lobewatch.arrays import Floats
from lobewatch.cuts.chatter_detection.cut_detection import find_cuts
from lobewatch.logbook.logbook import Logbook
from lobewatch.machine.journal.entries import RecordingFile
from lobewatch.machine.settings.requested_cut import CutSetting

MAX_AIR_SPEED_DIFFERENCE = 0.01
"""Largest relative difference of two commanded speeds of which the air is the same; chosen."""
SAME_RATE_TOLERANCE = 1e-3
"""Largest relative difference of the sample rates of one recorder, as columns of times are rounded; chosen."""
MAX_AIR_RECORDINGS = 5
"""Largest number of earlier recordings that are searched for air, the newest first; chosen."""


class RememberedAir(NamedTuple):
    """Air next to an earlier cut."""

    cut: str
    """Identity of the earlier cut."""
    signal: Floats
    """Its air in the unit of the recording, shape (axes, n)."""


def find_remembered_air(logbook: Logbook, setting: CutSetting, signal: CutSignal) -> RememberedAir | None:
    """Find the newest air at the speed of a cut, recorded with the same sensors; None without it."""
    for recorded in _list_similar_cuts(logbook, setting, signal):
        try:
            earlier, _ = read_cut_signal(logbook.folder.path / recorded.file)
        except (DataError, OSError):
            continue
        if not _is_same_recorder(earlier, signal):
            continue
        for parts in reversed(find_cuts(earlier.acceleration, earlier.sample_rate, 60 / setting.speed_rpm)):
            if not parts.reason:
                return RememberedAir(recorded.id, np.atleast_2d(earlier.acceleration)[:, parts.air])
    return None


def _list_similar_cuts(logbook: Logbook, setting: CutSetting, signal: CutSignal) -> list[RecordingFile]:
    """List the newest recordings of cuts at the same speed by the same kind of sensor."""
    similar = [
        entry.recording
        for entry in reversed(logbook.files.contents.cuts)
        if entry.recording is not None
        and not entry.excluded
        and entry.by == signal.sensor
        and abs(entry.commanded_rpm / setting.speed_rpm - 1) <= MAX_AIR_SPEED_DIFFERENCE
    ]
    return similar[:MAX_AIR_RECORDINGS]


def _is_same_recorder(one: CutSignal, other: CutSignal) -> bool:
    """Return whether two recordings have the same rate, sensors and channels."""
    if abs(one.sample_rate / other.sample_rate - 1) > SAME_RATE_TOLERANCE:
        return False
    return _list_sensors(one) == _list_sensors(other)


def _list_sensors(signal: CutSignal) -> list[tuple[str, str, str]]:
    """List kind, quantity and serial number of each sensor, the last two as far as known."""
    known = () if signal.channel is None else (signal.channel, *signal.more_channels)
    if known:
        return [(signal.sensor, channel.quantity, channel.serial_number) for channel in known]
    return [(signal.sensor, "", "")] * np.atleast_2d(signal.acceleration).shape[0]
