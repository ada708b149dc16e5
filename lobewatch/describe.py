"""Modes, calibrations, programs and measurements as JSON objects and as tables for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rich.markup import escape
from rich.table import Table

from dsm import Calibration, DampingCalibration, StiffnessFit
from lobes import StabilityLobes
from lobewatch.machine import REFERENCE_CUT, Machine
from lobewatch.output import plus_minus, table
from lobewatch.pipeline import Measurement
from modal import Mode


def mode_json(mode: Mode) -> dict[str, Any]:
    """One mode."""
    frequency, damping, stiffness = mode.standard_error
    return {
        "frequency_hz": mode.frequency,
        "frequency_hz_std": frequency,
        "damping_ratio": mode.damping_ratio,
        "damping_ratio_std": damping,
        "stiffness_n_per_m": mode.stiffness,
        "stiffness_n_per_m_std": stiffness,
        "driving_point": mode.is_driving_point,
        "method": mode.method,
    }


def mode_table(modes: Sequence[Mode]) -> Table:
    """Modes, a line each, value ± standard error."""
    made = table("f_n (Hz)", "zeta (%)", "K (N/um)", "<")
    for mode in modes:
        frequency, damping, stiffness = mode.standard_error
        made.add_row(
            plus_minus(mode.frequency, frequency),
            plus_minus(mode.damping_ratio, damping, 0.01),
            plus_minus(mode.stiffness, stiffness, 1e6),
            "" if mode.is_driving_point else "not a driving point",
        )
    return made


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


def program_json(lobes: Mapping[str, StabilityLobes], machine: Machine) -> list[dict[str, Any]]:
    """Each program of machine.toml that has lobes, against them."""
    programs = [program for program in machine.program if program.name in lobes]
    limits = [float(lobes[program.name].depth_at(program.speed_rpm)) for program in programs]
    return [
        {
            "name": program.name,
            "speed_rpm": program.speed_rpm,
            "depth_mm": program.depth_mm,
            "limit_mm": limit * 1e3,
            "stable": program.depth_mm < limit * 1e3,
        }
        for program, limit in zip(programs, limits, strict=True)
    ]


def program_table(programs: Sequence[dict[str, Any]]) -> Table:
    """Programs, a line each."""
    made = table("<program", "speed (rpm)", "depth (mm)", "limit (mm)", "<verdict")
    for entry in programs:
        made.add_row(
            escape(entry["name"]),
            f"{entry['speed_rpm']:g}",
            f"{entry['depth_mm']:g}",
            f"{entry['limit_mm']:.2f}",
            "stable" if entry["stable"] else "NOT STABLE",
        )
    return made


def lobes_json(name: str, lobes: StabilityLobes) -> dict[str, Any]:
    """The lowest point of a diagram."""
    low = lobes.minimum
    return {
        "cut": name,
        "method": lobes.method,
        "minimum_depth_mm": low.depth * 1e3,
        "at_speed_rpm": low.speed_rpm,
        "chatter_frequency_hz": low.chatter_frequency,
    }


def measurement_json(m: Measurement, machine: Machine) -> dict[str, Any]:
    """All of a measurement."""
    calibration = m.dynamics.calibration
    return {
        "tap_id": m.tap_id,
        "time": m.time.isoformat(),
        "tool": m.tool,
        "direction": m.direction,
        "modes": [mode_json(mode) for mode in m.dynamics.modes],
        "followed": mode_json(m.dynamics.followed) if m.dynamics.followed else None,
        "calibration": calibration_json(calibration) if calibration else None,
        "lobes": [lobes_json(name, lobes) for name, lobes in m.lobes.items()],
        "programs": program_json(m.lobes, machine),
        "notes": list(m.notes),
    }


def measurement_texts(m: Measurement, machine: Machine) -> list[str | Table]:
    """All of a measurement, for people."""
    texts: list[str | Table] = [f"{m.tap_id}  (tool {m.tool}, direction {m.direction})"]
    if m.dynamics.modes:
        texts.append(mode_table(m.dynamics.modes))
    if m.dynamics.followed is not None:
        texts.append(f"followed: {m.dynamics.followed.frequency:.2f} Hz")
    if m.dynamics.calibration is not None:
        texts.append(str(m.dynamics.calibration))
    if REFERENCE_CUT in m.lobes:
        low = m.lobes[REFERENCE_CUT].minimum
        texts.append(f"{REFERENCE_CUT}: lowest limit {low.depth * 1e3:.2f} mm at {low.speed_rpm:.0f} rpm")
    programs = program_json(m.lobes, machine)
    if programs:
        texts.append(program_table(programs))
    return [*texts, *(f"note: {note}" for note in m.notes)]
