"""Show sensors, sensor checks and the computer check."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rich.markup import escape
from rich.table import Table

from acquisition import STANDARD_GRAVITY, Channel
from dsm import format_with_error
from lobewatch.sensors import Finding, MassCheck, SensorList, SkewCheck
from lobewatch.show.terminal.json_fields import json_fields
from lobewatch.show.terminal.output import new_table

SENSORS_FIELDS = json_fields("""
    model=identity.model serial=identity.serial channels sample_rate_hz=nominal_rate measured_rate_hz=measured_rate.rate
    measured_rate_hz_std=measured_rate.std remarks errors
""")
CHANNEL_FIELDS = json_fields("""
    quantity direction sensitivity_v_per_si=sensitivity full_scale_v=full_scale full_scale_si=full_scale adc_bits
    serial_number calibration_date skew_us=skew*1e6
""")
MASS_CHECK_FIELDS = json_fields("""
    mass_kg=mass ratio ratio_std phase_deg=phase inverted flatness band_hz=band hits=n_hits agrees
    force_sensitivity_v_per_n=force_sensitivity acceleration_sensitivity_v_per_m_s2=acceleration_sensitivity remarks
""")
SKEW_CHECK_FIELDS = json_fields("""
    skew_us=measured.skew*1e6 skew_us_std=measured.std*1e6 skew_samples=measured.skew
    coherent_share=measured.coherent_share
""")


def sensors_json(sensors: SensorList) -> dict[str, Any]:
    """Return the device, its channels and its sample rate."""
    return SENSORS_FIELDS(sensors) | {"channels": [_channel_json(channel) for channel in sensors.channels]}


def sensors_texts(sensors: SensorList) -> list[str | Table]:
    """Return the device in words, a table of its channels, its sample rate, and warnings."""
    measured = sensors.measured_rate
    rate = "not measured" if measured is None else f"measured {format_with_error(measured.rate, measured.std)} Hz"
    rate += ", which is worked with" if sensors.replaces_nominal else ""
    return [
        f"{sensors.identity.model}, serial number {sensors.identity.serial or 'not known'}",
        new_table(*CHANNEL_HEADINGS, rows=(_channel_cells(i, channel) for i, channel in enumerate(sensors.channels))),
        f"rate: {sensors.nominal_rate:g} Hz, {rate}",
        *(f"{'error' if remark in sensors.errors else 'warning'}: {remark}" for remark in sensors.remarks),
    ]


def _channel_json(channel: Channel) -> dict[str, Any]:
    return CHANNEL_FIELDS(channel) | {"full_scale_si": channel.full_scale / abs(channel.sensitivity)}


CHANNEL_HEADINGS = "no", "<quantity", "sensitivity", "range", "input", "bits", "skew\n(us)", "~serial", "<calibrated"


def _channel_cells(number: int, channel: Channel) -> list[str]:
    unit, si = ("N", 1.0) if channel.quantity == "force" else ("g", STANDARD_GRAVITY)
    return [
        str(number),
        channel.name,
        f"{channel.sensitivity * 1e3 * si:.4g} mV/{unit}",
        f"±{channel.full_scale / abs(channel.sensitivity) / si:.4g} {unit}",
        f"±{channel.full_scale:g} V",
        str(channel.adc_bits),
        f"{channel.skew * 1e6:.4g}",
        escape(channel.serial_number or "-"),
        channel.calibration_date or "-",
    ]


def mass_check_json(check: MassCheck) -> dict[str, Any]:
    """Return the ratio F/(m a) of a hung mass, and the sensitivities that follow from it."""
    return MASS_CHECK_FIELDS(check.calibration)


def mass_check_texts(check: MassCheck) -> list[str]:
    """Return the result of the mass check, and what to change where."""
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
    """Return the skew between the channels and its standard error."""
    return SKEW_CHECK_FIELDS(check) | {"skew_samples": check.measured.skew * check.sample_rate}


def skew_check_texts(check: SkewCheck) -> list[str]:
    """Return the skew, and where to enter it."""
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
    """Return all findings on the computer, and how many prevent a tap test."""
    return {"findings": findings, "hinder": _count_state(findings, "hinders")}


def findings_texts(findings: Sequence[Finding]) -> list[str | Table]:
    """Return a table of the findings with their remedies, and a count."""
    marks = {"fine": "✓", "note": "·", "hinders": "✗"}
    rows = ((marks[item.state], *map(escape, (item.subject, item.text, item.cure))) for item in findings)
    table = new_table("<", "<what", "~there is", "~what to do", rows=rows)
    hinder, notes = _count_state(findings, "hinders"), _count_state(findings, "note")
    end = f"{hinder} of {len(findings)} stand in the way of a tap test" if hinder else "Nothing stands in the way"
    return [table, f"{end}; {notes} worth knowing" if notes else end]


def _count_state(findings: Sequence[Finding], state: str) -> int:
    return sum(finding.state == state for finding in findings)
