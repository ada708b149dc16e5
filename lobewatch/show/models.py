"""Show spindle models and their calibrations, from one tool or from several."""

import json

import numpy as np

from acquisition.errors import join_sentences
from dsm import Calibration, Joint, StiffnessFit, format_rounded, format_with_error
from lobewatch.logbook.joint_calibration import JointCalibration
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.measurement import ModelCalibration, ModelSummary
from lobewatch.show.terminal.output import JsonObject, Texts, new_table, pick

NODE_STIFFNESS_RATIO = 1e4
"""Smallest ratio of modal to static stiffness at the tip if the tip is a node of the mode."""


def calibration_json(calibration: Calibration) -> JsonObject:
    """Return a bearing stiffness calibrated to one mode, and the stiffness at the tool tip before and after."""
    return {
        "frequency_hz": calibration.frequency,
        "mode": calibration.mode,
        "theory": calibration.spindle.theory,
        "bearing_stiffness_n_per_m": calibration.bearing_stiffness,
        "bearing_stiffness_n_per_m_std": calibration.bearing_stiffness_std,
        "bearing_stiffness_n_per_m_interval": calibration.bearing_stiffness_interval,
        "residual_hz": calibration.residual,
        **pick(calibration, "factor", "sensitivity", "remarks", "energy_share"),
        "static_tip_stiffness_n_per_m": calibration.static_stiffness_after,
        "static_tip_stiffness_before_n_per_m": calibration.static_stiffness_before,
        "modal_tip_stiffness_n_per_m": calibration.modal_stiffness_after,
        "modal_tip_stiffness_before_n_per_m": calibration.modal_stiffness_before,
    }


def model_json(model: ModelSummary) -> JsonObject:
    """Return a spindle model with its modes."""
    spindle = model.state.spindle
    modes = [
        {
            "frequency_hz": mode.frequency,
            "modal_tip_stiffness_n_per_m": mode.tip_stiffness,
            "bearing_energy_share": mode.bearing_share,
            "segment_energy_share": mode.segment_share,
            "joint_energy_share": mode.joint_share,
        }
        for mode in model.modes
    ]
    return {
        "tool": model.state.tool,
        "bearings_from": model.state.origin,
        "theory": spindle.theory,
        "length_mm": spindle.length * 1e3,
        "mass_kg": spindle.mass,
        "modes": modes,
        "static_tip_stiffness_n_per_m": model.static_stiffness,
        "critical_speed_rpm": model.critical_speed,
        "first_frequency_with_rigid_bearings_hz": model.rigid_frequency,
    }


def stiffness_fit_json(fit: StiffnessFit) -> JsonObject:
    """Return stiffnesses fitted to several modes (N/m, tilting N m/rad), NaN for undetermined ones."""
    is_fitted, std = [group not in fit.open_groups for group in fit.groups], fit.stiffness_std
    errors = None if std is None else np.where(is_fitted, std, np.nan)
    values = np.where(is_fitted, fit.stiffness, np.nan)
    return {
        **pick(fit, "groups", "factor", "factor_std"),
        "stiffness_n_per_m": values,
        "stiffness_n_per_m_std": errors,
        "correlation": fit.correlation,
        "mode": fit.mode,
        "frequency_hz": fit.frequency,
        "residual_hz": fit.residual,
        **pick(fit, "energy_share", "condition", "remarks"),
    }


def model_calibration_json(calibration: ModelCalibration) -> JsonObject:
    """Return the stiffnesses and dampers that make a model fit."""
    stiffness, dampers = calibration.stiffness, calibration.dampers
    damping: JsonObject = {}
    if dampers is not None:
        damping = {"damping_ratio": dampers.damping_ratio, "bearing_damping_n_s_per_m": dampers.bearing_damping}
        damping |= {"bearing_damping_sensitivity": dampers.sensitivity}
    if isinstance(stiffness, Calibration):
        return calibration_json(stiffness) | {"preload_left": stiffness.remaining_preload} | damping
    return stiffness_fit_json(stiffness) | damping


def model_calibration_texts(calibration: ModelCalibration) -> list[str]:
    """Return the stiffnesses and dampers that make a model fit, in words."""
    stiffness = calibration.stiffness
    preload = stiffness.remaining_preload if isinstance(stiffness, Calibration) else None
    parts = (stiffness, preload, calibration.dampers)
    label = [f"model: {calibration.label}"] if calibration.label else []
    return [*label, *(str(part) for part in parts if part is not None)]


def model_texts(model: ModelSummary) -> Texts:
    """Return a spindle model in words, with a table of its modes."""
    spindle, critical = model.state.spindle, model.critical_speed
    table = new_table(
        "mode",
        "f (Hz)",
        "stiffness K at\nthe tip (N/um)",
        "bearing\nenergy (%)",
        "shaft\nenergy (%)",
        "joint\nenergy (%)",
    )
    for number, mode in enumerate(model.modes, 1):
        is_node = mode.tip_stiffness > NODE_STIFFNESS_RATIO * model.static_stiffness
        stiffness = "node" if is_node else format_rounded(mode.tip_stiffness, scale=1e6, digits=4)
        shares = (f"{100 * share:.1f}" for share in (mode.bearing_share, mode.segment_share, mode.joint_share))
        table.add_row(str(number), f"{mode.frequency:.2f}", stiffness, *shares)
    return [
        f"{model.state.title}: {spindle.theory}, {LENGTH.text(spindle.length * 1e3, '.1f')}, {spindle.mass:.2f} kg",
        f"bearing stiffness from {model.state.origin}",
        table,
        f"static stiffness at the tip  {model.static_stiffness / 1e6:.3f} N/um",
        f"critical speed               {'none' if critical is None else f'{critical:.0f} rpm'}",
        f"mode 1 with rigid bearings   {model.rigid_frequency:.1f} Hz",
    ]


def tools_json(calibration: JointCalibration) -> JsonObject:
    """Return the fit to several tools, its tap tests, and tools that it predicts."""
    fit = calibration.fit
    return {
        **stiffness_fit_json(fit),
        "taps": {tap.tool: tap.tap_id for tap in calibration.taps},
        "tool": [calibration.taps[i].tool for i in fit.shaft],
        "fits_one_spindle": not fit.has_misfit,
        "not_counted_hz": calibration.unmatched,
        "machine_toml": _joint_lines(calibration.joints),
        "predicted": {name: mode._asdict() for name, mode in calibration.predicted.items()},
        "remarks": [*fit.remarks, *calibration.remarks],
    }


def tools_texts(calibration: JointCalibration) -> Texts:
    """Return the fit to several tools in words, its tap tests, and tools that it predicts."""
    lines = [f"model: {calibration.label}"] if calibration.label else []
    for number, tap in enumerate(calibration.taps, 1):
        lines.append(f"spindle {number}: tool {tap.tool}, {tap.tap_id}, mode {tap.mode_number} followed")
    lines.append(str(calibration.fit))
    for tool, frequencies in calibration.unmatched.items():
        left_out = ", ".join(f"{frequency:.1f}" for frequency in frequencies)
        lines.append(f"not used: {left_out} Hz of tool {tool}, because the model has no mode nearby")
    lines += [f"warning: {remark}" for remark in calibration.remarks]
    if calibration.joints:
        unsure = ", ".join(sorted(calibration.fit.open_groups))
        caution = f" (undetermined: {unsure}, use all lines together)" if unsure else ""
        lines += [f"lines for [spindle] of machine.toml{caution}:", *_joint_lines(calibration.joints)]
    else:
        misfit = "The tools do not fit one spindle"
        finding = misfit if calibration.fit.has_misfit else "No measured mode depends on the joints"
        lines.append(join_sentences(finding, "Do not change [spindle] in machine.toml"))
    if not calibration.predicted or calibration.fit.has_misfit:
        return [*lines]
    table = new_table("~tool without tap test", "softest mode (Hz)", "stiffness K at the tip (N/um)")
    for name, mode in calibration.predicted.items():
        stiffness = format_with_error(mode.stiffness, mode.stiffness_std, 1e6)
        table.add_row(name, format_with_error(mode.frequency, mode.frequency_std), stiffness)
    return [*lines, table]


def _joint_lines(joints: tuple[Joint, ...]) -> list[str]:
    """Return joints as lines of machine.toml."""
    lines = [
        f"    {{ position_mm = {joint.position * 1e3:.6g}, stiffness_n_per_um = {joint.stiffness / 1e6:.4g}, "
        f"rotational_stiffness_n_m_per_rad = {joint.rotational_stiffness:.4g}, group = {json.dumps(joint.group)} }},"
        for joint in joints
    ]
    return ["joints = [", *lines, "]"] if joints else []
