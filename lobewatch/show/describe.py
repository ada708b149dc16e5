"""Modes, calibrations and models as JSON objects and as text for people."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich.table import Table

from acquisition import Remark, joined
from dsm import Calibration, DampingCalibration, StiffnessFit, plus_minus
from lobewatch.analysis import FileModes, ModelCalibration, ModelSummary
from lobewatch.show.output import table
from modal import Mode, trust_of


def mode_json(mode: Mode) -> dict[str, Any]:
    """One mode."""
    frequency, damping, stiffness = mode.standard_error
    by_fit = mode.fit_error
    return {
        "frequency_hz": mode.frequency,
        "frequency_hz_std": frequency,
        "frequency_hz_std_of_fit": by_fit[0],
        "damping_ratio": mode.damping_ratio,
        "damping_ratio_std": damping,
        "damping_ratio_std_of_fit": by_fit[1],
        "stiffness_n_per_m": mode.stiffness,
        "stiffness_n_per_m_std": stiffness,
        "stiffness_n_per_m_std_of_fit": by_fit[2],
        "interval_95": mode.interval(),
        "correlation": mode.correlation,
        "hits": mode.n_hits,
        "driving_point": mode.is_driving_point,
        "phase_deg": mode.phase_deg,
        "phase_deg_std": mode.phase_deg_std,
        "coherence": mode.coherence,
        "misfit": mode.misfit,
        "misfit_share": mode.misfit_share,
        "trust": trust_of(mode),
        "half_power_damping_ratio": mode.half_power_damping,
        "remarks": [asdict(remark) for remark in mode.remarks],
        "method": mode.method,
    }


def mode_table(modes: Sequence[Mode]) -> Table:
    """Modes, a line each, value ± standard error (in percent)."""
    made = table("f_n (Hz)", "zeta (%)", "K (N/um)", "<")
    for mode in modes:
        values = (mode.frequency, mode.damping_ratio, mode.stiffness)
        made.add_row(
            *(
                plus_minus(value, std, scale, percent=True)
                for value, std, scale in zip(values, mode.standard_error, (1.0, 0.01, 1e6), strict=True)
            ),
            "" if mode.is_driving_point else "not a driving point",
        )
    return made


def mode_lines(modes: Sequence[Mode]) -> list[str]:
    """What stands below a table of modes: where ± comes from, and correlated errors."""
    hits = max((mode.n_hits for mode in modes), default=0)
    lines = [f"± is the standard error over the {hits} hits (jackknife, {hits - 1} degrees of freedom)"] if hits else []
    for (i, j), names in (((0, 1), "f_n and zeta"), ((0, 2), "f_n and K"), ((1, 2), "zeta and K")):
        high = [f"{m.correlation[i, j]:+.2f} ({m.frequency:.0f} Hz)" for m in modes if abs(m.correlation[i, j]) > 0.5]
        if high:
            lines.append(f"correlation of the errors of {names}: {', '.join(high)}")
    return lines


def remark_lines(modes: Sequence[Mode], remarks: Sequence[Remark]) -> list[str]:
    """Remarks on single modes and further ones, a line each; what several modes have in common is one."""
    return [str(remark) for remark in joined([*(one for mode in modes for one in mode.remarks), *remarks])]


def picked_table(picked: Sequence[Mode], fitted: Sequence[Mode]) -> Table:
    """Modes by peak picking, and how far each is from the fitted mode nearest to it."""
    made = table("f_n (Hz)", "zeta (%)", "K (N/um)", "<against the fit")
    for mode in picked:
        near = min(fitted, key=lambda other: abs(other.frequency - mode.frequency), default=None)
        same = near is not None and abs(near.frequency - mode.frequency) < mode.damping_ratio * mode.frequency
        made.add_row(
            f"{mode.frequency:.5g}",
            f"{100 * mode.damping_ratio:.5g}",
            f"{mode.stiffness / 1e6:.5g}",
            _difference(mode, near) if same and near is not None else "not fitted",
        )
    return made


def _difference(mode: Mode, fit: Mode) -> str:
    zeta, k = mode.damping_ratio / fit.damping_ratio - 1, mode.stiffness / fit.stiffness - 1
    return f"f_n {mode.frequency - fit.frequency:+.2g} Hz, zeta {100 * zeta:+.1f} %, K {100 * k:+.1f} %"


def file_modes_json(found: FileModes) -> dict[str, Any]:
    """The modes of one file."""
    return {
        "file": str(found.path),
        "n_averages": found.frf.n_averages,
        "usable_band_hz": found.frf.usable_band,
        "modes": [mode_json(mode) for mode in found.fitted],
        "peak_picking": [mode_json(mode) for mode in found.picked],
        "remarks": [asdict(remark) for remark in found.remarks],
    }


def file_modes_texts(found: FileModes) -> list[str | Table]:
    """The modes of one file, for people."""
    frf = found.frf
    usable = "" if frf.usable_band is None else f", usable {frf.usable_band[0]:.0f} to {frf.usable_band[1]:.0f} Hz"
    lines = f"{frf.frequency.size} lines {frf.frequency[0]:g} to {frf.frequency[-1]:g} Hz"
    return [
        f"{found.path.name}: {frf.n_averages} hit(s) averaged, {lines}{usable}",
        mode_table(found.fitted),
        *mode_lines(found.fitted),
        *remark_lines(found.fitted, found.remarks),
        "peak picking (eqs. 28, 29), for comparison:",
        picked_table(found.picked, found.as_recorded),
    ]


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
        "energy_share": calibration.energy_share,
        "static_tip_stiffness_n_per_m": calibration.static_stiffness_after,
        "static_tip_stiffness_before_n_per_m": calibration.static_stiffness_before,
        "modal_tip_stiffness_n_per_m": calibration.modal_stiffness_after,
        "modal_tip_stiffness_before_n_per_m": calibration.modal_stiffness_before,
    }


def stiffness_fit_json(fit: StiffnessFit) -> dict[str, Any]:
    """Several stiffnesses from several modes."""
    return {
        "groups": list(fit.groups),
        "factor": fit.factor,
        "factor_std": fit.factor_std,
        "stiffness_n_per_m": fit.stiffness,
        "stiffness_n_per_m_std": fit.stiffness_std,
        "correlation": fit.correlation,
        "mode": fit.mode,
        "frequency_hz": fit.frequency,
        "residual_hz": fit.residual,
        "energy_share": fit.energy_share,
        "condition": fit.condition,
        "warnings": list(fit.warnings),
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
