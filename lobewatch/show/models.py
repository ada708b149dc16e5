"""Show spindle models and their calibrations, from one tool or from several."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any

import numpy as np
from rich.table import Table

from dsm import Calibration, DampingCalibration, Joint, StiffnessFit, format_rounded, format_with_error
from lobewatch.logbook.joint_calibration import JointCalibration
from lobewatch.measurement import ModelCalibration, ModelSummary
from lobewatch.show.terminal.output import new_table

NODE_STIFFNESS_RATIO = 1e4
"""Times the static stiffness at the tip: where that of a mode is higher, the tip is a node of it."""


def calibration_json(calibration: Calibration) -> dict[str, Any]:
    """The recalibrated model."""
    return {
        "frequency_hz": calibration.frequency,
        "mode": calibration.mode,
        "theory": calibration.spindle.theory,
        "bearing_stiffness_n_per_m": calibration.bearing_stiffness,
        "bearing_stiffness_n_per_m_std": calibration.bearing_stiffness_std,
        "bearing_stiffness_n_per_m_interval": calibration.bearing_stiffness_interval,
        "residual_hz": calibration.residual,
        "factor": calibration.factor,
        "sensitivity": calibration.sensitivity,
        "remarks": [asdict(remark) for remark in calibration.remarks],
        "energy_share": calibration.energy_share,
        "static_tip_stiffness_n_per_m": calibration.static_stiffness_after,
        "static_tip_stiffness_before_n_per_m": calibration.static_stiffness_before,
        "modal_tip_stiffness_n_per_m": calibration.modal_stiffness_after,
        "modal_tip_stiffness_before_n_per_m": calibration.modal_stiffness_before,
    }


def stiffness_fit_json(fit: StiffnessFit) -> dict[str, Any]:
    """Several stiffnesses from several modes; null for one that is open. Of tilting it is N m/rad."""
    is_fitted = [group not in fit.open_groups for group in fit.groups]
    return {
        "groups": list(fit.groups),
        "factor": fit.factor,
        "factor_std": fit.factor_std,
        "stiffness_n_per_m": np.where(is_fitted, fit.stiffness, np.nan),
        "stiffness_n_per_m_std": None if fit.stiffness_std is None else np.where(is_fitted, fit.stiffness_std, np.nan),
        "correlation": fit.correlation,
        "mode": fit.mode,
        "frequency_hz": fit.frequency,
        "residual_hz": fit.residual,
        "energy_share": fit.energy_share,
        "condition": fit.condition,
        "remarks": [asdict(remark) for remark in fit.remarks],
    }


def damping_json(calibration: DampingCalibration) -> dict[str, Any]:
    """The bearings' dampers."""
    return {
        "damping_ratio": calibration.damping_ratio,
        "bearing_damping_n_s_per_m": calibration.bearing_damping,
        "bearing_damping_sensitivity": calibration.sensitivity,
    }


def model_calibration_json(calibration: ModelCalibration) -> dict[str, Any]:
    """What makes a model fit."""
    dampers = {} if calibration.dampers is None else damping_json(calibration.dampers)
    return _stiffness_json(calibration.stiffness) | dampers


def _stiffness_json(stiffness: Calibration | StiffnessFit) -> dict[str, Any]:
    if isinstance(stiffness, Calibration):
        return calibration_json(stiffness) | {"preload_left": stiffness.remaining_preload}
    return stiffness_fit_json(stiffness)


def model_calibration_texts(calibration: ModelCalibration) -> list[str]:
    """What makes a model fit, for people."""
    label = [f"model: {calibration.label}"] if calibration.label else []
    preload = calibration.stiffness.remaining_preload if isinstance(calibration.stiffness, Calibration) else None
    return [*label, *(str(part) for part in (calibration.stiffness, preload, calibration.dampers) if part is not None)]


def model_json(model: ModelSummary) -> dict[str, Any]:
    """A model."""
    spindle = model.state.spindle
    return {
        "tool": model.state.tool,
        "bearings_from": model.state.origin,
        "theory": spindle.theory,
        "length_mm": spindle.length * 1e3,
        "mass_kg": spindle.mass,
        "modes": [
            {
                "frequency_hz": mode.frequency,
                "modal_tip_stiffness_n_per_m": mode.tip_stiffness,
                "bearing_energy_share": mode.bearing_share,
                "segment_energy_share": mode.segment_share,
                "joint_energy_share": mode.joint_share,
            }
            for mode in model.modes
        ],
        "static_tip_stiffness_n_per_m": model.static_stiffness,
        "critical_speed_rpm": model.critical_speed,
        "first_frequency_with_rigid_bearings_hz": model.rigid_frequency,
    }


def _tip_stiffness_text(stiffness: float, model: ModelSummary) -> str:
    return (
        "at rest"
        if stiffness > NODE_STIFFNESS_RATIO * model.static_stiffness
        else format_rounded(stiffness, scale=1e6, digits=4)
    )


def model_texts(model: ModelSummary) -> list[str | Table]:
    """A model for people."""
    spindle, critical = model.state.spindle, model.critical_speed
    mode_table = new_table(
        "mode", "f (Hz)", "K at the tip\n(N/um)", "energy in\nbearings (%)", "shaft (%)", "joints (%)"
    )
    for number, mode in enumerate(model.modes, 1):
        shares = (f"{100 * share:.1f}" for share in (mode.bearing_share, mode.segment_share, mode.joint_share))
        mode_table.add_row(
            str(number), f"{mode.frequency:.2f}", _tip_stiffness_text(mode.tip_stiffness, model), *shares
        )
    return [
        f"{model.state.title}: {spindle.theory}, {spindle.length * 1e3:.1f} mm, {spindle.mass:.2f} kg",
        f"bearings of {model.state.origin}",
        mode_table,
        f"static stiffness at the tip  {model.static_stiffness / 1e6:.3f} N/um",
        f"critical speed               {'none' if critical is None else f'{critical:.0f} rpm'}",
        f"with rigid bearings          {model.rigid_frequency:.1f} Hz in mode 1",
    ]


MISFIT_TEXT = "the tools do not fit one spindle: nothing is to be written into machine.toml"
UNDETERMINED_TEXT = "no measured mode feels the joints: nothing is to be written into machine.toml"


def tools_json(calibration: JointCalibration) -> dict[str, Any]:
    """The fit, what it rests on, and other tools as it has them."""
    return stiffness_fit_json(calibration.fit) | {
        "taps": {tap.tool: tap.tap_id for tap in calibration.taps},
        "tool": [calibration.taps[i].tool for i in calibration.fit.shaft],
        "fits_one_spindle": not calibration.fit.has_misfit,
        "not_counted_hz": calibration.unmatched,
        "machine_toml": _joint_lines(calibration.joints),
        "predicted": {name: mode._asdict() for name, mode in calibration.predicted.items()},
        "remarks": [*map(asdict, calibration.fit.remarks), *map(asdict, calibration.remarks)],
    }


def tools_texts(calibration: JointCalibration) -> list[str | Table]:
    """The fit, what it rests on, and other tools, for people."""
    label = [f"model: {calibration.label}"] if calibration.label else []
    taps = [
        f"spindle {number}: tool {tap.tool}, {tap.tap_id}, mode {tap.mode_number} is followed"
        for number, tap in enumerate(calibration.taps, 1)
    ]
    left = [
        f"not counted: {', '.join(f'{f:.1f}' for f in frequencies)} Hz of tool {tool}, nothing of the model is near"
        for tool, frequencies in calibration.unmatched.items()
    ]
    warnings = [f"warning: {remark}" for remark in calibration.remarks]
    return [
        *label,
        *taps,
        str(calibration.fit),
        *left,
        *warnings,
        *_joint_entry_lines(calibration),
        *_prediction_tables(calibration),
    ]


def _joint_entry_lines(calibration: JointCalibration) -> list[str]:
    if calibration.joints:
        unsure = ", ".join(sorted(calibration.fit.open_groups))
        caution = f" (open: {unsure}; good only together with the others)" if unsure else ""
        return [f"for [spindle] of machine.toml{caution}:", *_joint_lines(calibration.joints)]
    return [MISFIT_TEXT if calibration.fit.has_misfit else UNDETERMINED_TEXT]


def _joint_lines(joints: tuple[Joint, ...]) -> list[str]:
    """Joints as they stand in machine.toml."""
    if not joints:
        return []
    lines = [
        f"    {{ position_mm = {joint.position * 1e3:.6g}, stiffness_n_per_um = {joint.stiffness / 1e6:.4g}, "
        f"rotational_stiffness_n_m_per_rad = {joint.rotational_stiffness:.4g}, group = {json.dumps(joint.group)} }},"
        for joint in joints
    ]
    return ["joints = [", *lines, "]"]


def _prediction_tables(calibration: JointCalibration) -> list[Table]:
    if not calibration.predicted or calibration.fit.has_misfit:
        return []
    rows = new_table("~tool, not tapped here", "softest mode (Hz)", "K at the tip (N/um)")
    for name, mode in calibration.predicted.items():
        frequency = format_with_error(mode.frequency, mode.frequency_std)
        rows.add_row(name, frequency, format_with_error(mode.stiffness, mode.stiffness_std, 1e6))
    return [rows]
