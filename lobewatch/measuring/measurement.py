"""From one tap test to one measurement: modes, bearing stiffness, modes at the tool tip. A step that cannot be done is
recorded with its reason, and the next one goes on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cache

import numpy as np
from threadpoolctl import ThreadpoolController

from acquisition import Remark, TapTest
from dsm import Calibration, calibrate, modal_stiffness
from lobewatch.machine import Machine
from lobewatch.measuring.questions.asked import frequency_jump, no_mode_in_band, other_band, stiffness_off_model
from modal import Believed, Mode, believed, fit_modes, follow, predominant

BEARING_STIFFNESSES = (1e5, 1e11)
"""Of a calibrated model (N/m): from a plain bearing on a soft seat to a rigid seat."""
LARGEST_RATIO = 2.0
"""K of one test over that of the one before of the series, or the inverse, above which nothing is calibrated.

Wear of 10 % in frequency takes a third off K, tests scatter by a tenth, the smallest mistake of a unit is 4.4."""


@dataclass(frozen=True, eq=False)
class Measurement:
    """What one tap test says of the spindle."""

    tap_id: str
    """Of the tap test."""
    time: datetime
    """When it was taken."""
    tool: str
    """What was in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    modes: Sequence[Mode] = ()
    """All modes found, as measured."""
    followed: Mode | None = None
    """The mode that calibration and trend follow."""
    calibration: Calibration | None = None
    """The model recalibrated to it."""
    at_tip: Sequence[Mode] = ()
    """The modes that lobes are computed from, at the tool tip; empty where there are none."""
    remarks: tuple[Remark, ...] = ()
    """What could not be done, and what is in doubt."""


@dataclass(frozen=True, eq=False)
class TapFit:
    """What one tap test says by itself, whatever others said."""

    tap_id: str
    """Of the tap test."""
    time: datetime
    """When it was taken."""
    tool: str
    """What was in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    modes: Sequence[Mode] = ()
    """All modes found, as measured."""
    remarks: tuple[Remark, ...] = ()
    """What is in doubt, and why there are no modes."""
    failed: bool = False
    """Whether the fit was not possible at all."""


@cache
def _threads() -> ThreadpoolController:
    """Looking for the libraries takes longer than many a fit."""
    return ThreadpoolController()


def measure(tap: TapTest, machine: Machine, last: Mode | None = None) -> Measurement:
    """All that follows from one tap test; last: the mode that was followed in the test before."""
    return measure_fit(fit_tap(tap, machine), machine, last)


def fit_tap(tap: TapTest, machine: Machine) -> TapFit:
    """The modes of one tap test: most of the work, and the part that needs no other tap test."""
    about, band = tap.circumstances, other_band(tap.frf, machine)
    remarks = () if band is None else (band,)
    named = (tap.id, about.created, about.tool, about.direction)
    with _threads().limit(limits=1):
        try:
            return TapFit(*named, fit_modes(tap.frf, hits=tap.accepted), remarks)
        except ValueError as error:
            none = Remark("no-modes", "", f"no modes: {error}")
            return TapFit(*named, (), (*remarks, none, no_mode_in_band((), machine)), failed=True)


def measure_fit(fit: TapFit, machine: Machine, last: Mode | None) -> Measurement:
    """What follows from these modes; last: the mode that was followed in the test before."""
    remarks, modes = [*fit.remarks], fit.modes
    named = (fit.tap_id, fit.time, fit.tool, fit.direction)
    if fit.failed:
        return Measurement(*named, remarks=fit.remarks)
    with _threads().limit(limits=1):
        found = believed(_in_band(modes, machine))
        remarks += found.remarks
        followed = _follow(found, modes, machine, remarks, last)
        calibration = _calibrate(followed, machine, fit.tool, remarks, last)
        at_tip = _modes_at_tip(found, followed, calibration, machine, remarks)
    return Measurement(*named, modes, followed, calibration, at_tip, tuple(remarks))


def _in_band(modes: Sequence[Mode], machine: Machine) -> list[Mode]:
    low, high = machine.mode.band_hz or (0.0, np.inf)
    return [mode for mode in modes if low <= mode.frequency <= high]


def _follow(
    found: Believed, modes: Sequence[Mode], machine: Machine, remarks: list[Remark], last: Mode | None
) -> Mode | None:
    """The believed mode that continues the last one, the predominant one where there is none yet."""
    mode = predominant(found.modes)
    if mode is None:
        remarks.append(no_mode_in_band(modes, machine))
    elif last is not None:
        mode = _continued(last, mode, found.modes, remarks)
    return mode


def _continued(last: Mode, now: Mode, candidates: Sequence[Mode], remarks: list[Remark]) -> Mode | None:
    """now: the predominant one, which is taken, and asked about, where none is like the last one and it is far off."""
    found = follow(last, candidates)
    jump = frequency_jump(last, now) if found.mode is None else None
    if jump is not None:
        remarks.append(jump)
        return now
    cure = "for a rebuilt spindle lay [mode] band_hz around its new mode" if found.mode is None else ""
    remarks += [replace(remark, cure=cure or remark.cure) for remark in found.remarks]
    return found.mode


def _calibrate(
    followed: Mode | None, machine: Machine, tool: str, remarks: list[Remark], last: Mode | None
) -> Calibration | None:
    if followed is None:
        return None
    std = float(followed.standard_error[0])
    try:
        spindle = machine.model(tool)
        found = calibrate(spindle, followed.frequency, std if np.isfinite(std) else None, machine.mode.model_mode)
    except (ValueError, ArithmeticError) as error:
        remarks.append(Remark("no-bearing-stiffness", "", f"no bearing stiffness: {error}"))
        return None
    doubt = _calibration_doubt(found, followed, last)
    remarks += [] if doubt is None else [doubt]
    if doubt is None and last is None:
        there = modal_stiffness(found.spindle, found.mode, machine.tap.position_mm / 1e3)
        remarks += filter(None, [stiffness_off_model(followed, there)])
    return found if doubt is None else None


def _calibration_doubt(found: Calibration, followed: Mode, last: Mode | None) -> Remark | None:
    """Why a calibration is not believed; None where it is."""
    low, high = BEARING_STIFFNESSES
    before = followed.stiffness if last is None else last.stiffness
    ratio = followed.stiffness / before
    if not low <= found.bearing_stiffness <= high:
        text = f"bearing stiffness {found.bearing_stiffness:.3g} N/m is outside {low:g} to {high:g} N/m"
        cure = "compare [spindle] with the drawing, and [mode] model_mode with the mode that is tapped"
    elif not 1 / LARGEST_RATIO <= ratio <= LARGEST_RATIO:
        text = f"K was {before:.3g} N/m in the test before, is {followed.stiffness:.3g} now, {ratio:.2g} times as much"
        cure = "tap again; compare the sensitivities of hammer and accelerometer, and where it was tapped"
    else:
        return None
    return Remark("calibration-not-believed", "", f"bearing stiffness unknown: {text}", cure)


def _modes_at_tip(
    found: Believed,
    followed: Mode | None,
    calibration: Calibration | None,
    machine: Machine,
    remarks: list[Remark],
) -> list[Mode]:
    """Believed modes, carried to the tip by the model where the tap was elsewhere; none where one has K < 0."""
    if not found.modes:
        return []
    if found.against:
        where = ", ".join(f"{mode.frequency:.0f}" for mode in found.against)
        text = f"no stability lobes: not a driving point, the stiffness of the modes at {where} Hz is negative"
        cure = "hit and measure at one point in one direction, or leave these modes out with [mode] band_hz"
        remarks.append(Remark("no-lobes-driving-point", "", text, cure))
        return []
    if machine.tap.position_mm == 0:
        return list(found.modes)
    if calibration is None or followed is None:
        text = "no stability lobes: the tap was not at the tool tip ([tap] position_mm), and no model is calibrated"
        remarks.append(Remark("no-lobes-beside-tip", "", text, "tap at the tip, or add a [spindle]"))
        return []
    return [_carried_to_tip(followed, calibration, machine.tap.position_mm / 1e3)]


def _carried_to_tip(mode: Mode, calibration: Calibration, position: float) -> Mode:
    number = calibration.mode
    ratio = modal_stiffness(calibration.spindle, number) / modal_stiffness(calibration.spindle, number, position)
    return mode.scaled(1.0, ratio, "model to tip")
