"""What is drawn of a model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquisition import Frf
from dsm import Modes, Spindle, WhirlMap, mode_shapes, natural_frequencies, stiffness_curve, whirl_map
from lobewatch.history.usable_taps import NotTappedError
from lobewatch.logbook.logbook import Logbook
from lobewatch.measuring.model import POINTS, ModelState, first_critical_speed, model_frf, tap_position

_Float = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ModelPicture:
    """What is drawn of a model."""

    title: str
    """Headline."""
    spindle: Spindle
    """The shaft."""
    modes: Modes
    """Modes along the shaft."""
    curve: tuple[_Float, _Float]
    """Bearing stiffness (N/m) and frequency (Hz) of the followed mode, shape (n,) each."""
    points: tuple[_Float, _Float]
    """The same of the tap tests."""
    whirl: WhirlMap
    """Whirl frequencies over speed."""
    highest_speed: float
    """End of the speed range of the machine (rpm)."""
    frf_place: str
    """Place of force and motion of the frequency responses, in words."""
    model_frf: Frf
    """Frequency response of the model."""
    measured_frf: Frf | None
    """Newest measured one of the same tool."""


def model_picture(logbook: Logbook, state: ModelState, modes: int) -> ModelPicture:
    """What `lobewatch model --figure` draws."""
    spindle, machine = state.spindle, state.machine
    speeds = np.linspace(0.0, 1.15 * (first_critical_speed(spindle) or machine.speed.high_rpm), 24)
    return ModelPicture(
        title=state.title,
        spindle=spindle,
        modes=mode_shapes(spindle, min(modes, 4), np.linspace(0.0, spindle.length, POINTS)),
        curve=_curve(spindle, machine.mode.model_mode),
        points=_points(logbook, state.tool),
        whirl=whirl_map(spindle, speeds, min(modes, 2)),
        highest_speed=machine.speed.high_rpm,
        frf_place="at the tool tip" if tap_position(state) == 0 else f"{tap_position(state) * 1e3:g} mm from the tip",
        model_frf=model_frf(state),
        measured_frf=_measured_frf(logbook, state.tool),
    )


def _curve(spindle: Spindle, mode: int) -> tuple[_Float, _Float]:
    """Bearing stiffness over the followed frequency, from a thirtieth to thirty times the present one."""
    if not any(bearing.group and np.isfinite(bearing.stiffness) for bearing in spindle.bearings):
        return np.empty(0), np.empty(0)
    ends = []
    for factor in (1 / 30, 30.0):
        scaled = [replace(bearing, stiffness=factor * bearing.stiffness) for bearing in spindle.bearings]
        ends.append(float(natural_frequencies(replace(spindle, bearings=scaled), mode)[-1]))
    frequency = np.linspace(ends[0], ends[1], POINTS)[1:-1]
    return stiffness_curve(spindle, frequency, mode), frequency


def _points(logbook: Logbook, tool: str) -> tuple[_Float, _Float]:
    calibrated_rows = [row for row in logbook.history.current if row.tool == tool and row.bearing_stiffness.is_known]
    points = np.array([(row.bearing_stiffness.value, row.frequency.value) for row in calibrated_rows]).reshape(-1, 2)
    return points[:, 0], points[:, 1]


def _measured_frf(logbook: Logbook, tool: str) -> Frf | None:
    try:
        return logbook.folder.read(logbook.newest(tool)).frf
    except NotTappedError:
        return None
