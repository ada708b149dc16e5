"""Read the recording of a cut by accelerometers or a microphone."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from acquisition.arrays import Floats
from acquisition.errors import DataError
from acquisition.files.contents.column_headings import assign_columns, format_signal_names
from acquisition.files.contents.contents import Contents, Signal
from acquisition.files.contents.description import Description, ImportReport
from acquisition.files.contents.resolve_hits import apply_full_scale, infer_kind, resolve_rate
from acquisition.files.contents.resolve_unit import choose_signal, convert_to_sensor_units, resolve_response_unit
from acquisition.files.contents.spindle_speed import resolve_speed, split_speed_column
from acquisition.files.cut_file import CutSignal, is_cut_file, read_cut_signal
from acquisition.files.read_recording import EMPTY_DESCRIPTION, detect_format, read_contents

CUT_COLUMNS_EXAMPLE = '--columns "time [s],acceleration [m/s^2]", in their order, or each with =NAME'
"""How an acceleration is named."""
MICROPHONE_SENSOR = "microphone"
"""Sensor whose values need no unit: what is told rests on how loud one is beside another."""


def resolve_cut_signals(
    contents: Contents, description: Description, report: ImportReport
) -> tuple[Floats, float, Floats | None] | None:
    """What heard a cut, its sample rate (Hz), and the speed of the spindle where the file has it (rpm, shape (n,)).

    None where the report says what is missing or wrong.

    Acceleration in m/s^2, a microphone in what the file holds: shape (n,), or (responses, n) where there are several
    and nobody says which is meant.
    """
    named = assign_columns(contents.signals, description.columns, report) if description.columns else contents.signals
    signals, turning = split_speed_column(named, description, report)
    is_microphone = description.sensor == MICROPHONE_SENSOR
    in_units = (
        list(signals)
        if is_microphone and not description.full_scale
        else apply_full_scale(signals, description, report)
    )
    scaled = convert_to_sensor_units(in_units, description, report)
    if scaled is None or not report.is_clean:
        return None
    over_time = [signal for signal in scaled if signal.role not in ("time", "frequency", "ignored", "frf", "coherence")]
    responses = [signal for signal in over_time if infer_kind(signal) == "response"]
    heard = responses or [signal for signal in over_time if not infer_kind(signal)]
    if not heard:
        report.add_missing(
            f"which of its columns is the acceleration ({format_signal_names(signals)})", CUT_COLUMNS_EXAMPLE
        )
        return None
    meant = (
        [choose_signal(heard, description.response, "responses", report)] if description.response is not None else heard
    )
    settled = [signal for signal in meant if signal is not None]
    factors = [
        1.0 if is_microphone else _resolve_acceleration_factor(signal, description, report) for signal in settled
    ]
    beside = [turning] if turning is not None and settled else []
    rate, used = resolve_rate(scaled, [*settled, *beside], description, report)
    if is_microphone and responses:
        report.faults.append(f"{responses[0].name} moves; leave --sensor microphone out")
    if not settled or not report.is_clean:
        return None
    settled, beside = used[: len(settled)], used[len(settled) :]
    speed = resolve_speed(beside[0], rate, description, report) if beside else None
    if not report.is_clean:
        return None
    values = np.stack([signal.values * factor for signal, factor in zip(settled, factors, strict=True)])
    return np.asarray(values if len(settled) > 1 else values[0], dtype=np.float64), rate, speed


def _resolve_acceleration_factor(signal: Signal, description: Description, report: ImportReport) -> float:
    """Of an acceleration, to m/s^2; 0 where it is none, or its unit is not known."""
    unit = resolve_response_unit(signal, description, report)
    if unit is None:
        return 0.0
    if unit[0] != "acceleration":
        report.faults.append(f"{signal.name} is a {unit[0]}; a cut is heard by an accelerometer")
    return unit[1]


def read_cut_recording(path: Path | str, description: Description = EMPTY_DESCRIPTION) -> CutSignal:
    """What accelerometers or a microphone have recorded; DataError for a file without, or that says not enough."""
    path = Path(path)
    if not path.is_file():
        raise DataError(f"{path}: no such file")
    if is_cut_file(path):
        return read_cut_signal(path)[0]
    file_format = detect_format(path)
    contents = read_contents(file_format, path, description)
    if not isinstance(contents, Contents):
        raise DataError(f"{path}: a {file_format.title}, not the recording of a cut")
    report = ImportReport()
    sound = resolve_cut_signals(contents, description, report)
    if sound is None or not report.is_clean:
        raise DataError(f"{path}: {report.format_problems()}")
    if not np.all(np.isfinite(sound[0])):
        raise DataError(f"{path}: holds values that are no numbers; export it again")
    values, rate, speed = sound
    return CutSignal(values, rate, sensor=description.sensor, speed_rpm=speed)
