"""lobewatch sensors."""

from __future__ import annotations

from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.markup import escape
from rich.table import Table

from acquisition import (
    Channel,
    DeviceError,
    Hit,
    MassCalibration,
    MeasuredRate,
    MeasuredSkew,
    Remark,
    Source,
    calibrate_by_mass,
    capture_hits,
    judge_hit,
    measure_rate,
    measure_skew,
)
from acquisition.files.units import STANDARD_GRAVITY
from dsm import plus_minus
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.known_devices import Device, checked_rate, has_clock, use_rate
from lobewatch.machine.named_folder import named_folder
from lobewatch.show.output import Json, emit, notes, table
from lobewatch.tap.live_signal import LiveSignal
from lobewatch.tap.plug import open_source
from lobewatch.tap.self_check import quiet_stretch
from lobewatch.tap.sensor_doubts import WRONG, sensor_doubts
from lobewatch.tap.trial import Trial

RATE_SECONDS = 5.0
"""How long the rate is measured (s)."""
BASELINE_SECONDS = 0.5
"""How long is listened before the first hit (s)."""
SKEW_SECONDS = 2.0
"""How long a common signal is recorded (s)."""


def sensors(
    machine: Annotated[Path, typer.Argument(parser=named_folder, help="Machine folder.")],
    port: Annotated[str, typer.Option(help="Serial port of the DAQ, or socket://HOST:PORT.")] = "",
    mass_kg: Annotated[
        float | None, typer.Option(help="Check F = m a on a hung mass: all that moves, accelerometer included (kg).")
    ] = None,
    skew: Annotated[bool, typer.Option("--skew", help="Measure the skew: both inputs joined, one signal.")] = False,
    as_json: Json = False,
) -> None:
    """Hammer, accelerometer and DAQ: what they are, and whether they are right.

    Without an option: channels, dates, what is not plausible, and the sample rate against this computer's clock.

    Examples:

      lobewatch sensors mill-3 --port /dev/ttyACM0

      lobewatch sensors mill-3 --mass-kg 1.052

      lobewatch sensors mill-3 --skew
    """
    folder = MachineFolder(machine)
    port = port or folder.machine.daq.port
    if not port:
        raise ValueError(f"no port: give --port, or port in [daq] of {folder.toml}")
    if mass_kg is not None and skew:
        raise ValueError("--mass-kg and --skew need different cabling; give one of them")
    with folder.locked(), open_source(folder.machine.daq, port) as source:
        if mass_kg is not None:
            _check_mass(folder, source, mass_kg, as_json)
        elif skew:
            _measure_skew(folder, source, as_json)
        else:
            _list(folder, source, as_json)


def _list(folder: MachineFolder, source: Source, as_json: bool) -> None:
    today = datetime.now(UTC).date()
    remarks = sensor_doubts(source.channels, today, folder.machine.daq.calibration_interval_months)
    nominal = source.sample_rate
    measured = _rate(folder, source, remarks)
    errors = [remark for remark in remarks if remark.code in WRONG]
    found = "not measured" if measured is None else f"measured {plus_minus(measured.rate, measured.std)} Hz"
    found += ", which is worked with" if source.sample_rate != nominal else ""
    name = _name(source)
    emit(
        {
            **name,
            "channels": [_channel_json(channel) for channel in source.channels],
            "sample_rate_hz": nominal,
            "measured_rate_hz": measured.rate if measured else None,
            "measured_rate_hz_std": measured.std if measured else None,
            "remarks": [asdict(remark) for remark in remarks],
            "errors": [asdict(remark) for remark in errors],
        },
        as_json,
        f"{name['model']}, serial number {name['serial'] or 'not known'}",
        _channel_table(source.channels),
        f"rate: {nominal:g} Hz, {found}",
        *(f"{'error' if remark in errors else 'warning'}: {remark}" for remark in remarks),
    )
    if errors:
        raise typer.Exit(2)


def _name(source: Source) -> dict[str, str]:
    info = source.info if isinstance(source, Device) else {}
    return {"model": str(info.get("model", "recording")), "serial": str(info.get("serial", ""))}


def _rate(folder: MachineFolder, source: Source, remarks: list[Remark]) -> MeasuredRate | None:
    """The measured rate, kept for this device where it is right; what is wrong with it goes to the remarks."""
    if not has_clock(source):
        return None
    notes.print(f"measuring the rate for {RATE_SECONDS:g} s", markup=False)
    measured = None
    try:
        measured = measure_rate(source, RATE_SECONDS)
        use_rate(folder, source, measured)
    except DeviceError as error:
        remarks.append(Remark("sample-rate-wrong", "", str(error)))
    return measured


def _channel_json(channel: Channel) -> dict[str, Any]:
    return {
        "quantity": channel.quantity,
        "sensitivity_v_per_si": channel.sensitivity,
        "full_scale_v": channel.full_scale,
        "full_scale_si": channel.full_scale / abs(channel.sensitivity),
        "adc_bits": channel.adc_bits,
        "serial_number": channel.serial_number,
        "calibration_date": channel.calibration_date,
        "skew_us": channel.skew * 1e6,
    }


def _channel_table(channels: tuple[Channel, ...]) -> Table:
    made = table("channel", "<quantity", "sensitivity", "range", "input", "bits", "skew (us)", "<serial", "<calibrated")
    for i, channel in enumerate(channels):
        unit, si = ("N", 1.0) if channel.quantity == "force" else ("g", STANDARD_GRAVITY)
        made.add_row(
            str(i),
            channel.quantity,
            f"{channel.sensitivity * 1e3 * si:.4g} mV/{unit}",
            f"±{channel.full_scale / abs(channel.sensitivity) / si:.4g} {unit}",
            f"±{channel.full_scale:g} V",
            str(channel.adc_bits),
            f"{channel.skew * 1e6:.4g}",
            escape(channel.serial_number or "-"),
            channel.calibration_date or "-",
        )
    return made


def _check_mass(folder: MachineFolder, source: Source, mass: float, as_json: bool) -> None:
    found = calibrate_by_mass(_good_hits(folder, source), mass)
    emit(_mass_json(found), as_json, str(found), *_where_to_change(source, found))


def _good_hits(folder: MachineFolder, source: Source) -> list[Hit]:
    wanted = folder.machine.tap.hits
    checked_rate(folder, source)
    notes.print(f"HIT the hung mass opposite the accelerometer, {wanted} times; wait until it is still")
    good: list[Hit] = []
    source.start()
    baseline = quiet_stretch(LiveSignal(source).record(source.blocks(), BASELINE_SECONDS))
    for hit in capture_hits(source, Trial(folder.machine.tap, baseline).trigger):
        found = judge_hit(hit)
        if not found.flags:
            good.append(hit)
        verdict = f"✗ {found.flags.words.upper()}  {found.text}" if found.flags else "✓ GOOD"
        notes.print(f"{len(good):3d} / {wanted}  {verdict}", markup=False)
        if len(good) >= wanted:
            break
    source.stop()
    return good


def _mass_json(found: MassCalibration) -> dict[str, Any]:
    return {
        "mass_kg": found.mass,
        "ratio": found.ratio,
        "ratio_std": found.ratio_std,
        "phase_deg": found.phase,
        "inverted": found.inverted,
        "flatness": found.flatness,
        "band_hz": found.band,
        "hits": found.n_hits,
        "agrees": found.agrees,
        "force_sensitivity_v_per_n": found.force_sensitivity,
        "acceleration_sensitivity_v_per_m_s2": found.acceleration_sensitivity,
        "remarks": [asdict(remark) for remark in found.remarks],
    }


def _where_to_change(source: Source, found: MassCalibration) -> list[str]:
    if found.sizes_agree:
        return []
    if _describes_itself(source):
        force, acceleration = "sens_V_per_EU of the force channel", "that of the acceleration channel"
        place = "the device's own channel data (INFO)"
    else:
        force, acceleration, place = "sensitivity_mv_per_n", "sensitivity_mv_per_g", "[[daq.channel]] of machine.toml"
    return [
        f"To change in {place}: multiply {force} by {found.ratio:.4f}, or divide {acceleration} by {found.ratio:.4f}."
    ]


def _describes_itself(source: Source) -> bool:
    """A TAPS/1 device brings the data of its channels with it."""
    return isinstance(source, Device) and "channels" in source.info


def _measure_skew(folder: MachineFolder, source: Source, as_json: bool) -> None:
    rate = checked_rate(folder, source)
    notes.print(f"recording {SKEW_SECONDS:g} s: both inputs joined with a T-piece, noise or taps on them")
    blocks = []
    source.start()
    for block in source.blocks():
        blocks.append(block.codes)
        if sum(codes.shape[1] for codes in blocks) >= SKEW_SECONDS * rate:
            break
    source.stop()
    first, second = np.concatenate(blocks, axis=1)
    found = measure_skew(first, second, rate)
    emit(_skew_json(found, rate), as_json, *_skew_texts(source, found, rate))


def _skew_json(found: MeasuredSkew, rate: float) -> dict[str, Any]:
    return {
        "skew_us": found.skew * 1e6,
        "skew_us_std": found.std * 1e6,
        "skew_samples": found.skew * rate,
        "coherent_share": found.coherent_share,
    }


def _skew_texts(source: Source, found: MeasuredSkew, rate: float) -> list[str]:
    second = source.channels[1]
    if _describes_itself(source):
        entry = f"skew_s = {found.skew:.3e} in the device's own channel data (INFO)"
    else:
        entry = f"skew_us = {found.skew * 1e6:.3f} in its [[daq.channel]] of machine.toml"
    return [
        f"channel 1 ({second.quantity}) is sampled {plus_minus(found.skew, found.std, 1e-6)} us "
        f"({found.skew * rate:.4f} samples) after channel 0; entered is {second.skew * 1e6:.3f} us",
        f"To enter: {entry}; 0 for channel 0",
    ]
