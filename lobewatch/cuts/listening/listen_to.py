"""What a recording says of the cuts in it: each is found, and told by itself."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lobewatch.cuts.listening.find_cut import CutParts, find_cuts
from lobewatch.cuts.listening.judge_cut import HeardSound, judge_cut
from lobewatch.cuts.listening.spectrum import Floats


class CutRecording(NamedTuple):
    """A recording that is to be listened to."""

    signal: Floats
    """Acceleration of the housing (m/s^2), shape (n,), or (axes, n) where several axes hear one spindle."""
    sample_rate: float
    """Sample rate (Hz)."""
    teeth: int
    """Number of teeth of the cutter."""
    immersion: float
    """Radial depth over diameter (-)."""
    commanded_rpm: float
    """Spindle speed as it was set (rpm)."""
    clipped: NDArray[np.bool_] | None = None
    """Overload of the sensor or its input, shape (n,); None: nowhere."""
    lost_scans: int = 0
    """Number of scans that are missing."""
    measured_rpm: Floats | None = None
    """Spindle speed by a tachometer at each sample (rpm), NaN where it gave none, shape (n,); None without one."""


def listen_to(recording: CutRecording) -> list[HeardSound]:
    """Tell each cut in a recording; one sound at least, which says why where there is no cut.

    Reasons why one cannot be told are those of `find_cuts` and `judge_cut`, "overload" and "lost-scans".
    """
    return [
        _heard(recording, parts)
        for parts in find_cuts(recording.signal, recording.sample_rate, 60 / recording.commanded_rpm)
    ]


def _heard(recording: CutRecording, parts: CutParts) -> HeardSound:
    reason = _fault(recording, parts)
    if reason and reason != "no-air":
        return HeardSound("cannot tell", reason, parts)
    measured = None if recording.measured_rpm is None else _mean(recording.measured_rpm[parts.cut])
    axes = np.atleast_2d(np.asarray(recording.signal, dtype=np.float64))
    sound = judge_cut(
        axes[:, parts.cut],
        axes[:, parts.air if not reason else slice(0, 0)],
        recording.sample_rate,
        recording.teeth,
        recording.immersion,
        recording.commanded_rpm,
        measured,
    )
    return replace(sound, parts=parts, measured_rpm=measured)


def _mean(speed: Floats) -> float:
    """Over the time in which it is known; NaN where it is known in less than half of it."""
    known = speed[np.isfinite(speed)]
    return float(np.mean(known)) if 2 * known.size > speed.size else np.nan


def _fault(recording: CutRecording, parts: CutParts) -> str:
    """Why the signal cannot be trusted, a code; empty where it can."""
    if parts.reason == "too-short":
        return parts.reason
    if recording.clipped is not None and np.any(recording.clipped if parts.reason else recording.clipped[parts.cut]):
        return "overload"
    return "lost-scans" if recording.lost_scans else parts.reason
