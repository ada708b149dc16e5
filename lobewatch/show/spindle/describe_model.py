"""Calibrations and models as JSON objects and as text for people."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from rich.table import Table

from dsm import Calibration, DampingCalibration, StiffnessFit, rounded
from lobewatch.measuring import ModelCalibration, ModelSummary
from lobewatch.show.terminal.output import table

AT_REST = 1e4
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
        return calibration_json(stiffness) | {"preload_left": stiffness.preload_left}
    return stiffness_fit_json(stiffness)


def model_calibration_texts(calibration: ModelCalibration) -> list[str]:
    """What makes a model fit, for people."""
    label = [f"model: {calibration.label}"] if calibration.label else []
    preload = calibration.stiffness.preload_left if isinstance(calibration.stiffness, Calibration) else None
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


def _tip_stiffness(stiffness: float, model: ModelSummary) -> str:
    return "at rest" if stiffness > AT_REST * model.static_stiffness else rounded(stiffness, scale=1e6, digits=4)


def model_texts(model: ModelSummary) -> list[str | Table]:
    """A model for people."""
    spindle, critical = model.state.spindle, model.critical_speed
    mode_table = table("mode", "f (Hz)", "K at the tip\n(N/um)", "energy in\nbearings (%)", "shaft (%)", "joints (%)")
    for number, mode in enumerate(model.modes, 1):
        shares = (f"{100 * share:.1f}" for share in (mode.bearing_share, mode.segment_share, mode.joint_share))
        mode_table.add_row(str(number), f"{mode.frequency:.2f}", _tip_stiffness(mode.tip_stiffness, model), *shares)
    return [
        f"{model.state.title}: {spindle.theory}, {spindle.length * 1e3:.1f} mm, {spindle.mass:.2f} kg",
        f"bearings of {model.state.origin}",
        mode_table,
        f"static stiffness at the tip  {model.static_stiffness / 1e6:.3f} N/um",
        f"critical speed               {'none' if critical is None else f'{critical:.0f} rpm'}",
        f"with rigid bearings          {model.rigid_frequency:.1f} Hz in mode 1",
    ]
