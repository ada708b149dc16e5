"""Calibrations and models as JSON objects and as text for people."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from rich.table import Table

from dsm import Calibration, DampingCalibration, StiffnessFit
from lobewatch.measuring import ModelCalibration, ModelSummary
from lobewatch.show.terminal.output import table


def calibration_json(calibration: Calibration) -> dict[str, Any]:
    """The recalibrated model."""
    return {
        "frequency_hz": calibration.frequency,
        "mode": calibration.mode,
        "theory": calibration.spindle.theory,
        "bearing_stiffness_n_per_m": calibration.bearing_stiffness,
        "bearing_stiffness_n_per_m_std": calibration.bearing_stiffness_std,
        "residual_hz": calibration.residual,
        "factor": calibration.factor,
        "sensitivity": calibration.sensitivity,
        "preload_left": calibration.preload_left,
        "remarks": [asdict(remark) for remark in calibration.remarks],
        "energy_share": calibration.energy_share,
        "static_tip_stiffness_n_per_m": calibration.static_stiffness_after,
        "static_tip_stiffness_before_n_per_m": calibration.static_stiffness_before,
        "modal_tip_stiffness_n_per_m": calibration.modal_stiffness_after,
        "modal_tip_stiffness_before_n_per_m": calibration.modal_stiffness_before,
    }


def stiffness_fit_json(fit: StiffnessFit) -> dict[str, Any]:
    """Several stiffnesses from several modes; null for one that is open. Of tilting it is N m/rad."""
    known = [group not in fit.open_groups for group in fit.groups]
    return {
        "groups": list(fit.groups),
        "factor": fit.factor,
        "factor_std": fit.factor_std,
        "stiffness_n_per_m": np.where(known, fit.stiffness, np.nan),
        "stiffness_n_per_m_std": None if fit.stiffness_std is None else np.where(known, fit.stiffness_std, np.nan),
        "correlation": fit.correlation,
        "mode": fit.mode,
        "frequency_hz": fit.frequency,
        "residual_hz": fit.residual,
        "energy_share": fit.energy_share,
        "condition": fit.condition,
        "remarks": [asdict(remark) for remark in fit.remarks],
    }


def damping_json(found: DampingCalibration) -> dict[str, Any]:
    """The bearings' dampers."""
    return {
        "damping_ratio": found.damping_ratio,
        "bearing_damping_n_s_per_m": found.bearing_damping,
        "bearing_damping_sensitivity": found.sensitivity,
    }


def model_calibration_json(found: ModelCalibration) -> dict[str, Any]:
    """What makes a model fit."""
    stiffness = found.stiffness
    payload = calibration_json(stiffness) if isinstance(stiffness, Calibration) else stiffness_fit_json(stiffness)
    return payload if found.dampers is None else payload | damping_json(found.dampers)


def model_calibration_texts(found: ModelCalibration) -> list[str]:
    """What makes a model fit, for people."""
    label = [f"model: {found.label}"] if found.label else []
    dampers = [] if found.dampers is None else [str(found.dampers)]
    return [*label, str(found.stiffness), *dampers]


def model_json(found: ModelSummary) -> dict[str, Any]:
    """A model."""
    spindle = found.state.spindle
    return {
        "tool": found.state.tool,
        "bearings_from": found.state.origin,
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
            for mode in found.modes
        ],
        "static_tip_stiffness_n_per_m": found.static_stiffness,
        "critical_speed_rpm": found.critical_speed,
        "first_frequency_with_rigid_bearings_hz": found.rigid_frequency,
    }


def model_texts(found: ModelSummary) -> list[str | Table]:
    """A model for people."""
    spindle, critical = found.state.spindle, found.critical_speed
    made = table("mode", "f (Hz)", "K at the tip (N/um)", "energy in bearings (%)", "shaft (%)", "joints (%)")
    for number, mode in enumerate(found.modes, 1):
        shares = (f"{100 * share:.1f}" for share in (mode.bearing_share, mode.segment_share, mode.joint_share))
        made.add_row(str(number), f"{mode.frequency:.2f}", f"{mode.tip_stiffness / 1e6:.4g}", *shares)
    return [
        f"{found.state.title}: {spindle.theory}, {spindle.length * 1e3:.1f} mm, {spindle.mass:.2f} kg",
        f"bearings of {found.state.origin}",
        made,
        f"static stiffness at the tip  {found.static_stiffness / 1e6:.3f} N/um",
        f"critical speed               {'none' if critical is None else f'{critical:.0f} rpm'}",
        f"with rigid bearings          {found.rigid_frequency:.1f} Hz in mode 1",
    ]
