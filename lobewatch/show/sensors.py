"""Show sensors, their checks, and what was found of the computer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich.markup import escape
from rich.table import Table

from acquisition import STANDARD_GRAVITY, Channel
from dsm import format_with_error
from lobewatch.sensors import Finding, MassCheck, SensorList, SkewCheck
from lobewatch.show.terminal.output import new_table


def sensors_json(sensors: SensorList) -> dict[str, Any]:
    """The device, its channels and its rate."""
    measured = sensors.measured_rate
    return {
        "model": sensors.identity.model,
        "serial": sensors.identity.serial,
        "channels": [_channel_json(channel) for channel in sensors.channels],
        "sample_rate_hz": sensors.nominal_rate,
        "measured_rate_hz": measured.rate if measured else None,
        "measured_rate_hz_std": measured.std if measured else None,
        "remarks": [asdict(remark) for remark in sensors.remarks],
        "errors": [asdict(remark) for remark in sensors.errors],
    }


def sensors_texts(sensors: SensorList) -> list[str | Table]:
    """The device, a table of its channels, its rate, and what is wrong."""
    measured = sensors.measured_rate
    rate = "not measured" if measured is None else f"measured {format_with_error(measured.rate, measured.std)} Hz"
    rate += ", which is worked with" if sensors.replaces_nominal else ""
    return [
        f"{sensors.identity.model}, serial number {sensors.identity.serial or 'not known'}",
        _channel_table(sensors.channels),
        f"rate: {sensors.nominal_rate:g} Hz, {rate}",
        *(f"{'error' if remark in sensors.errors else 'warning'}: {remark}" for remark in sensors.remarks),
    ]


def _channel_json(channel: Channel) -> dict[str, Any]:
    return {
        "quantity": channel.quantity,
        "direction": channel.direction,
        "sensitivity_v_per_si": channel.sensitivity,
        "full_scale_v": channel.full_scale,
        "full_scale_si": channel.full_scale / abs(channel.sensitivity),
        "adc_bits": channel.adc_bits,
        "serial_number": channel.serial_number,
        "calibration_date": channel.calibration_date,
        "skew_us": channel.skew * 1e6,
    }


def _channel_table(channels: tuple[Channel, ...]) -> Table:
    rows = new_table("no", "<quantity", "sensitivity", "range", "input", "bits", "skew\n(us)", "~serial", "<calibrated")
    for i, channel in enumerate(channels):
        unit, si = ("N", 1.0) if channel.quantity == "force" else ("g", STANDARD_GRAVITY)
        rows.add_row(
            str(i),
            channel.name,
            f"{channel.sensitivity * 1e3 * si:.4g} mV/{unit}",
            f"±{channel.full_scale / abs(channel.sensitivity) / si:.4g} {unit}",
            f"±{channel.full_scale:g} V",
            str(channel.adc_bits),
            f"{channel.skew * 1e6:.4g}",
            escape(channel.serial_number or "-"),
            channel.calibration_date or "-",
        )
    return rows


def mass_check_json(check: MassCheck) -> dict[str, Any]:
    """F/(m a) and what follows from it."""
    calibration = check.calibration
    return {
        "mass_kg": calibration.mass,
        "ratio": calibration.ratio,
        "ratio_std": calibration.ratio_std,
        "phase_deg": calibration.phase,
        "inverted": calibration.inverted,
        "flatness": calibration.flatness,
        "band_hz": calibration.band,
        "hits": calibration.n_hits,
        "agrees": calibration.agrees,
        "force_sensitivity_v_per_n": calibration.force_sensitivity,
        "acceleration_sensitivity_v_per_m_s2": calibration.acceleration_sensitivity,
        "remarks": [asdict(remark) for remark in calibration.remarks],
    }


def mass_check_texts(check: MassCheck) -> list[str]:
    """The verdict, and what to change where."""
    ratio = check.calibration.ratio
    if check.calibration.sizes_agree:
        return [str(check.calibration)]
    if check.place is None:
        force, acceleration, place = "sensitivity_mv_per_n", "sensitivity_mv_per_g", "[[daq.channel]] of machine.toml"
    else:
        force, acceleration = f"{check.place.sensitivity} of the force channel", "that of the acceleration channel"
        place = check.place.place
    change = f"To change in {place}: multiply {force} by {ratio:.4f}, or divide {acceleration} by {ratio:.4f}."
    return [str(check.calibration), change]


def skew_check_json(check: SkewCheck) -> dict[str, Any]:
    """The skew and how sure it is."""
    return {
        "skew_us": check.measured.skew * 1e6,
        "skew_us_std": check.measured.std * 1e6,
        "skew_samples": check.measured.skew * check.sample_rate,
        "coherent_share": check.measured.coherent_share,
    }


def skew_check_texts(check: SkewCheck) -> list[str]:
    """The skew, and where to enter it."""
    skew, channel = check.measured, check.channel
    if check.place is None:
        entry = f"skew_us = {skew.skew * 1e6:.3f} in its [[daq.channel]] of machine.toml"
    else:
        entry = f"{check.place.skew} = {skew.skew:.3e} in {check.place.place}"
    return [
        f"channel 1 ({channel.quantity}) is sampled {format_with_error(skew.skew, skew.std, 1e-6)} us "
        f"({skew.skew * check.sample_rate:.4f} samples) after channel 0; entered is {channel.skew * 1e6:.3f} us",
        f"To enter: {entry}; 0 for channel 0",
    ]


def findings_json(findings: Sequence[Finding]) -> dict[str, Any]:
    """All findings, and how many stand in the way."""
    return {"findings": [asdict(finding) for finding in findings], "hinder": _count_state(findings, "hinders")}


def findings_texts(findings: Sequence[Finding]) -> list[str | Table]:
    """A table, a line each with its cure, and a count."""
    rows = new_table("<", "<what", "~there is", "~what to do")
    marks = {"fine": "✓", "note": "·", "hinders": "✗"}
    for finding in findings:
        rows.add_row(marks[finding.state], *map(escape, (finding.subject, finding.text, finding.cure)))
    hinder, notes = _count_state(findings, "hinders"), _count_state(findings, "note")
    end = f"{hinder} of {len(findings)} stand in the way of a tap test" if hinder else "Nothing stands in the way"
    return [rows, f"{end}; {notes} worth knowing" if notes else end]


def _count_state(findings: Sequence[Finding], state: str) -> int:
    return sum(finding.state == state for finding in findings)
