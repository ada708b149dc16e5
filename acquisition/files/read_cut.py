"""Read the recording of a cut by accelerometers or a microphone."""

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

CUT_COLUMNS_EXAMPLE = ' "time [s],acceleration [m/s^2]", in their order, or each with =NAME'
"""Example of the columns of a cut."""
MICROPHONE_SENSOR = "microphone"
"""Sensor whose values need no unit, because only their ratios count."""


def read_cut_recording(path: Path | str, description: Description = EMPTY_DESCRIPTION) -> CutSignal:
    """Read what accelerometers or a microphone recorded of a cut, from a file of any known format.

    Raises DataError for a file without such a signal, or with too few statements.
    """
    path = Path(path)
    if not path.is_file():
        raise DataError(f"{path}: no such file")
    if is_cut_file(path):
        return read_cut_signal(path)[0]
    file_format = detect_format(path)
    contents = read_contents(file_format, path, description)
    if not isinstance(contents, Contents):
        raise DataError(f"{path}: a {file_format.title}, not the recording of a cut")
    report = ImportReport(description)
    signals = report.attempt(_resolve_cut_signals, contents)
    if signals is None:
        raise DataError(f"{path}: {report.format_problems()}")
    values, rate, speed = signals
    if not np.all(np.isfinite(values)):
        raise DataError(f"{path}: holds values that are no numbers; export it again")
    return CutSignal(values, rate, sensor=description.sensor, speed_rpm=speed)


def _resolve_cut_signals(contents: Contents, report: ImportReport) -> tuple[Floats, float, Floats | None]:
    """Return signal, sample rate (Hz) and spindle speed (rpm, shape (n,), None without one) of a cut.

    The signal is an acceleration (m/s^2), or what a microphone recorded: shape (n,), or (responses, n) where there are
    several and the description chooses none.
    """
    description = report.description
    signals, speed_signal = split_speed_column(assign_columns(contents.signals, report), report)
    is_microphone = description.sensor == MICROPHONE_SENSOR
    needs_scale = not is_microphone or description.full_scale
    scaled = convert_to_sensor_units(apply_full_scale(signals, report) if needs_scale else signals, report)
    report.require_clean()
    over_time = [signal for signal in scaled if signal.role not in ("time", "frequency", "ignored", "frf", "coherence")]
    responses = [signal for signal in over_time if infer_kind(signal) == "response"]
    candidates = responses or [signal for signal in over_time if not infer_kind(signal)]
    if not candidates:
        fact = f"which of its columns is the acceleration ({format_signal_names(signals)})"
        raise report.add_missing(fact, "columns", CUT_COLUMNS_EXAMPLE)
    if description.response is not None:
        one = report.attempt(choose_signal, candidates, "responses")
        candidates = [] if one is None else [one]
    factors = [1.0 if is_microphone else report.attempt(_resolve_factor, signal) for signal in candidates]
    speed_signals = [speed_signal] if speed_signal is not None and candidates else []
    rate, used = resolve_rate(scaled, [*candidates, *speed_signals], report)
    if is_microphone and responses:
        report.add_fault(f"{responses[0].name} moves; leave Description.sensor microphone out")
    report.require_clean()
    speed = resolve_speed(used[-1], rate, report) if speed_signals else None
    values = np.stack([signal.values * factor for signal, factor in zip(used, factors, strict=False)])
    return np.asarray(values if len(factors) > 1 else values[0], dtype=np.float64), rate, speed


def _resolve_factor(signal: Signal, report: ImportReport) -> float:
    """Return the factor of an acceleration to m/s^2."""
    quantity, factor = resolve_response_unit(signal, report)
    if quantity != "acceleration":
        raise report.add_fault(f"{signal.name} is a {quantity}; a cut is heard by an accelerometer")
    return factor
