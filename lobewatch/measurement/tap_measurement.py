"""Measure one tap test: modes, followed mode, bearing stiffness and modes at the tool tip."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import cache, partial
from typing import Any

import numpy as np
from threadpoolctl import ThreadpoolController

import modal
from acquisition import CROSS_TAP, Frf, Hit, Remark, TapTest
from dsm import Calibration, calibrate, format_rounded, modal_stiffness
from lobewatch.machine import NO_MODE_EDITS, Machine, TapEntry
from lobewatch.measurement import recording_questions as questions
from lobewatch.measurement.coverage import find_uncovered, find_uncovered_peaks
from lobewatch.measurement.exponential_window import hidden_window_remarks
from lobewatch.measurement.hit_choice import find_choice_remarks
from lobewatch.measurement.hit_remarks import (
    describe_changes,
    drop_explained_remedies,
    find_changes_in_band,
    select_uncovered_changes,
)
from lobewatch.measurement.repeated_samples import repeated_samples_remarks
from lobewatch.measurement.sensor_effects import FrfFit, decay_remarks, extract_decay_modes, fit_on_time
from lobewatch.measurement.series_modes import find_series_questions
from lobewatch.measurement.series_questions import NO_REFERENCE, SeriesReference
from lobewatch.measurement.tool_compliance import check_tool_compliance
from lobewatch.measurement.touch_remarks import touch_remarks
from lobewatch.step_times import time_step
from modal import CredibleModes, Extraction, HitChange, Mode, ModeEdits, UnexplainedPeak

EDITS_NOT_APPLIED_CODE = "hand-not-applied"
MODE_EDIT_CODES = ("modes-by-hand", EDITS_NOT_APPLIED_CODE)
"""Codes of the remarks on mode edits."""
LOST_MODE_CODES = (questions.FREQUENCY_JUMP.code, questions.NO_MODE_TO_FOLLOW.code)
"""Codes of the questions about another mode, which is not compared with the series."""
BEARING_STIFFNESS_RANGE = (1e5, 1e11)
"""Plausible bearing stiffness (N/m), from a plain bearing on a soft seat to a rigid seat."""
MAX_STIFFNESS_CHANGE_RATIO = 2.0
"""Ratio of K of two successive tests, or the inverse, above which nothing is calibrated. Wear of 10 % in frequency
takes a third off K, tests scatter by a tenth, the smallest mistake of a unit is 4.4."""


@dataclass(frozen=True, eq=False)
class TapFit:
    """Fitted modes of one tap test, independent of other tests."""

    tap_id: str
    """Identity of the tap test."""
    time: datetime
    """Time of the tap test."""
    tool: str
    """Tool in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    modes: Sequence[Mode] = ()
    """All modes as measured."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on missing and doubtful results."""
    failed: bool = False
    """True if the fit was impossible."""
    frf: Frf | None = None
    """FRF that was fitted, in its usable band and without the mass of the sensor; None without force."""
    changes: tuple[HitChange, ...] = ()
    """Changes from hit to hit whose remark makes verdicts doubtful."""

    @property
    def uncovered(self) -> tuple[Remark, ...]:
        """Remarks that say the modes do not cover the measurement (`coverage.UNCOVERED_CODES`)."""
        return find_uncovered(self.remarks)


@dataclass(frozen=True, eq=False)
class Measurement(TapFit):
    """Result of one tap test: its fit, followed mode and calibrated model."""

    followed: Mode | None = None
    """Mode of calibration and trend; None without one."""
    calibration: Calibration | None = None
    """Model calibrated to the followed mode; None if impossible or implausible."""
    at_tip: Sequence[Mode] = ()
    """Modes at the tool tip for lobes, with one for each unexplained peak; empty without any."""
    cross: Sequence[Mode] | None = None
    """Signed modes of a cross FRF at the tool tip; None for other tests and away from the tip."""
    used: Sequence[Mode] = ()
    """Modes used for lobes, as measured; of either sign for a cross FRF."""
    unexplained: tuple[UnexplainedPeak, ...] = ()
    """Measured peaks that the used modes do not explain."""


@cache
def _thread_controller() -> ThreadpoolController:
    """Return the controller of the numerical libraries, whose search takes longer than a fit."""
    return ThreadpoolController()


def measure(
    tap: TapTest,
    machine: Machine,
    last: Mode | None = None,
    by_hand: ModeEdits = NO_MODE_EDITS,
    reference: SeriesReference = NO_REFERENCE,
) -> Measurement:
    """Measure one tap test.

    Parameters
    ----------
    tap
        Tap test.
    machine
        Machine with its settings.
    last
        Followed mode of the previous test; None for the first one.
    by_hand
        Mode edits.
    reference
        Earlier tests of the series, whose numbers are compared.

    Returns
    -------
    Measurement
        Modes, followed mode, calibrated model, and remarks.
    """
    return interpret_fit(fit_tap(tap, machine, by_hand), machine, last, reference)


@time_step("fitting")
def fit_tap(tap: TapTest, machine: Machine, by_hand: ModeEdits = NO_MODE_EDITS) -> TapFit:
    """Fit the modes of one tap test, the largest part of the work, which needs no other test.

    by_hand: mode edits; if they are impossible, the fitted modes stay, with a remark.
    """
    about, band = tap.circumstances, None if tap.frf is None else questions.check_band_coverage(tap.frf, machine)
    remarks = (*find_choice_remarks(tap.flags, tap.decisions), *repeated_samples_remarks(tap.accepted))
    remarks += () if band is None else (band,)
    named = (tap.id, about.created, about.tool, about.direction)
    with _thread_controller().limit(limits=1):
        try:
            over_hits = find_changes_in_band(tap.hits, machine.mode.band_hz, tap.decided_flags)
            changes, uncovered = tuple(describe_changes(over_hits)), select_uncovered_changes(over_hits)
            if tap.frf is None:
                state, edited = _apply_edits(extract_decay_modes(tap.accepted), by_hand)
                said = (*remarks, *edited, *decay_remarks(machine.tap.sensor), *changes)
                return TapFit(*named, drop_explained_remedies(modal.modes_from_decays(state), changes), said)
            fit = partial(_fit_frf, by_hand=by_hand)
            *_, fitted = fit_on_time(tap.frf, tap.accepted, machine.tap.sensor, fit)
            about_hits = (*hidden_window_remarks(tap.accepted, fitted.modes), *touch_remarks(tap.accepted), *changes)
            quantity = filter(None, [questions.check_quantity(fitted.modes)])
            said = (*remarks, *fitted.remarks, *about_hits, *quantity)
            modes = drop_explained_remedies(fitted.modes, changes)
            return TapFit(*named, modes, said, frf=fitted.extraction.frf, changes=uncovered)
        except ValueError as error:
            failure = Remark("no-modes", "", f"no modes: {error}")
            return TapFit(*named, (), (*remarks, failure, questions.no_mode_remark((), machine)), failed=True)


def _fit_frf(frf: Frf, hits: Sequence[Hit], by_hand: ModeEdits) -> FrfFit:
    state, remarks = _apply_edits(modal.extract_modes([frf]), by_hand)
    return FrfFit(state, tuple(modal.modes_from_extraction(state, [hits])), remarks)


def _apply_edits(state: Extraction, by_hand: ModeEdits) -> tuple[Extraction, tuple[Remark, ...]]:
    """Apply mode edits, or return the extraction with a remark if they are impossible."""
    try:
        return modal.edit_modes(state, by_hand) if by_hand else state, mode_edits_remarks(by_hand)
    except ValueError as error:
        cure = "Change the edits with folder_updates.store_mode_edits, or undo them with NO_MODE_EDITS"
        return state, (Remark(EDITS_NOT_APPLIED_CODE, str(by_hand), str(error), cure),)


def mode_edits_remarks(by_hand: ModeEdits) -> tuple[Remark, ...]:
    """Return the remark on mode edits; none without any."""
    return (Remark("modes-by-hand", str(by_hand), "modes chosen by the user"),) if by_hand else ()


def interpret_fit(
    fit: TapFit, machine: Machine, last: Mode | None, reference: SeriesReference = NO_REFERENCE
) -> Measurement:
    """Follow the mode, calibrate the model and find the modes at the tip.

    last: followed mode of the previous test; reference: earlier tests of the series.
    """
    if fit.direction == CROSS_TAP:
        return _interpret_cross_tap(fit, machine, last)
    if fit.failed:
        return Measurement(**vars(fit))
    remarks, modes = [*fit.remarks], fit.modes
    with _thread_controller().limit(limits=1):
        trusted = modal.select_credible_modes(_select_in_band(modes, machine))
        remarks += trusted.remarks
        band = None if fit.frf is None else fit.frf.usable_band
        followed = _follow_mode(trusted, modes, machine, remarks, last, band)
        if followed is not None and not any(remark.code in LOST_MODE_CODES for remark in remarks):
            remarks += find_series_questions(followed, trusted.modes, reference)
        calibration = _calibrate(followed, machine, fit.tool, remarks, last)
        at_tip = _transfer_to_tip(trusted, followed, calibration, machine, remarks)
        is_at_tip = machine.tap.position_mm == 0
        if at_tip and is_at_tip and fit.frf is not None:
            highest = float(fit.frf.frequency[-1])
            remarks += filter(None, [check_tool_compliance(modes, machine, fit.tool, highest)])
        used = trusted.modes if is_at_tip or followed is None else (followed,)
        unexplained, about_peaks = find_uncovered_peaks(fit.frf if at_tip else None, used, machine, fit.changes)
        at_tip += [peak.missing for peak in unexplained if is_at_tip]
    results: dict[str, Any] = {"followed": followed, "calibration": calibration, "at_tip": at_tip}
    results |= {"used": used, "unexplained": unexplained, "remarks": (*remarks, *about_peaks)}
    return Measurement(**vars(fit) | results)


def _interpret_cross_tap(fit: TapFit, machine: Machine, last: Mode | None) -> Measurement:
    """Interpret a cross FRF: modes of either sign, and no calibration."""
    signed = _select_in_band(fit.modes, machine)
    plain = [replace(mode, stiffness=abs(mode.stiffness)) for mode in signed]
    trusted = modal.select_credible_modes(plain)
    cross = [mode for mode, size in zip(signed, plain, strict=True) if size in trusted.modes]
    followed = modal.predominant_mode(trusted.modes) if last is None else modal.follow_mode(last, trusted.modes).mode
    remarks = [remark for remark in fit.remarks if remark.code != "no-mode-in-band"]
    if machine.tap.position_mm:
        text = "cross tap not used, because it was not at the tool tip ([tap] position_mm)"
        remarks.append(Remark("cross-beside-tip", "", text, "Repeat the cross tap at the tool tip"))
    knows_size = all(mode.has_stiffness for mode in cross)
    at_tip = cross if knows_size and not machine.tap.position_mm else None
    unexplained, _ = find_uncovered_peaks(fit.frf, cross, machine)
    results: dict[str, Any] = {"followed": followed, "cross": at_tip, "unexplained": unexplained}
    results |= {"used": cross if knows_size else (), "remarks": (*remarks, *trusted.remarks)}
    return Measurement(**vars(fit) | results)


def _select_in_band(modes: Sequence[Mode], machine: Machine) -> list[Mode]:
    low, high = machine.mode.band_hz or (0.0, np.inf)
    return [mode for mode in modes if low <= mode.frequency <= high]


def _follow_mode(
    trusted: CredibleModes,
    modes: Sequence[Mode],
    machine: Machine,
    remarks: list[Remark],
    last: Mode | None,
    band: tuple[float, float] | None,
) -> Mode | None:
    """Return the credible mode that continues the last one; without a last one, or far off, the predominant one."""
    now = modal.predominant_mode(trusted.modes)
    if now is None:
        remarks.append(questions.no_mode_remark(modes, machine))
    if now is None or last is None:
        return now
    next_mode = modal.follow_mode(last, trusted.modes)
    jump = questions.check_frequency_jump(last, now) if next_mode.mode is None else None
    if jump is not None:
        remarks.append(questions.check_followed_band(last, band) or jump)
        return now
    cure = "For a rebuilt spindle, set [mode] band_hz around its new mode" if next_mode.mode is None else ""
    remarks += [replace(remark, cure=cure or remark.cure) for remark in next_mode.remarks]
    return next_mode.mode


def _calibrate(
    followed: Mode | None, machine: Machine, tool: str, remarks: list[Remark], last: Mode | None
) -> Calibration | None:
    if followed is None:
        return None
    std = float(followed.standard_error[0])
    try:
        spindle = machine.model(tool)
        calibration = calibrate(spindle, followed.frequency, std if np.isfinite(std) else None, machine.mode.model_mode)
    except (ValueError, ArithmeticError) as error:
        remarks.append(Remark("no-bearing-stiffness", "", f"bearing stiffness unknown: {error}"))
        return None
    doubt = _check_calibration(calibration, followed, last)
    remarks += [] if doubt is None else [doubt]
    if doubt is None and last is None and followed.has_stiffness:
        of_model = modal_stiffness(calibration.spindle, calibration.mode, machine.tap.position_mm / 1e3)
        remarks += filter(None, [questions.check_model_stiffness(followed, of_model)])
    return calibration if doubt is None else None


def _check_calibration(calibration: Calibration, followed: Mode, last: Mode | None) -> Remark | None:
    """Return the reason why a calibration is implausible, or None."""
    low, high = BEARING_STIFFNESS_RANGE
    before = followed.stiffness if last is None else last.stiffness
    ratio = followed.stiffness / before if followed.has_stiffness and not math.isnan(before) else 1.0
    if not low <= calibration.bearing_stiffness <= high:
        stiffness = format_rounded(calibration.bearing_stiffness, scale=1e6, digits=3)
        text = f"{stiffness} N/um is outside {low / 1e6:g} to {high / 1e6:.0f} N/um"
        cure = "Compare [spindle] with the drawing, and [mode] model_mode with the tapped mode"
    elif not 1 / MAX_STIFFNESS_CHANGE_RATIO <= ratio <= MAX_STIFFNESS_CHANGE_RATIO:
        then, now = (format_rounded(stiffness, scale=1e6, digits=3) for stiffness in (before, followed.stiffness))
        text = f"stiffness K changed from {then} to {now} N/um since the previous test ({ratio:.2g} times)"
        cure = "Tap again, and check hit point and sensitivities of hammer and accelerometer"
    else:
        return None
    return Remark("calibration-not-believed", "", f"bearing stiffness implausible: {text}", cure)


def _transfer_to_tip(
    trusted: CredibleModes, followed: Mode | None, model: Calibration | None, machine: Machine, remarks: list[Remark]
) -> list[Mode]:
    """Return the modes at the tip, by the model if tapped elsewhere; empty if a K is negative."""
    if not trusted.modes or not all(mode.has_stiffness for mode in trusted.modes):
        return []
    if trusted.opposed:
        where = ", ".join(f"{mode.frequency:.0f}" for mode in trusted.opposed)
        text = f"no stability lobes, because stiffness K is negative at {where} Hz (not a driving point)"
        cure = "Hit and measure at one point in one direction, or leave these modes out with [mode] band_hz"
        remarks.append(Remark("no-lobes-driving-point", "", text, cure))
        return []
    if machine.tap.position_mm == 0:
        return list(trusted.modes)
    if model is None or followed is None:
        text = "no stability lobes without a calibrated model, because [tap] position_mm is not at the tool tip"
        remarks.append(Remark("no-lobes-beside-tip", "", text, "Tap at the tip, or add a [spindle] table"))
        return []
    at_tap = modal_stiffness(model.spindle, model.mode, machine.tap.position_mm / 1e3)
    return [followed.scaled(1.0, modal_stiffness(model.spindle, model.mode) / at_tap, "model to tip")]


def is_fit_of(answer: object, entry: TapEntry) -> bool:
    """Tell whether a worker's answer is a plausible fit of a tap test."""
    return (
        isinstance(answer, TapFit)
        and (answer.tap_id, answer.time.isoformat()) == (entry.id, entry.time)
        and (answer.tool, answer.direction) == (entry.tool, entry.direction)
        and isinstance(answer.failed, bool)
        and (answer.frf is None or (isinstance(answer.frf, Frf) and _is_valid(answer.frf)))
        and all(isinstance(remark, Remark) for remark in answer.remarks)
        and all(isinstance(mode, Mode) and _is_valid(mode) for mode in answer.modes)
    )


def _is_valid(part: Mode | Frf) -> bool:
    try:
        replace(part)  # what has come from elsewhere was never checked
    except (TypeError, ValueError):
        return False
    return True
