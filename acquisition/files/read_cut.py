"""Read the recording of a cut by accelerometers or a microphone, and of its spindle speed."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from acquisition.arrays import Floats
from acquisition.errors import DataError
from acquisition.files.contents.column_headings import assign_columns, find_column, format_signal_names
from acquisition.files.contents.contents import Contents, Description, ImportReport, Signal
from acquisition.files.contents.resolve_hits import apply_full_scale, infer_kind, resolve_rate
from acquisition.files.contents.resolve_unit import choose_signal, convert_to_sensor_units, resolve_response_unit
from acquisition.files.contents.units import parse_unit
from acquisition.files.cut_file import CutSignal, is_cut_file, read_cut_signal
from acquisition.files.read_recording import EMPTY_DESCRIPTION, detect_format, read_contents

PULSE_ON_LEVEL, PULSE_OFF_LEVEL = 0.6, 0.4
"""Levels of the signal, as shares of its range, above which a pulse begins and below which it ends; chosen."""
MAX_TURN_RATIO = 1.4
"""Ratio of the time of a turn to that of its neighbours, or its inverse, from which pulses are missing or too many."""
MIN_REGULAR_TURNS_SHARE = 0.8
"""Smallest share of turns that are as long as their neighbours."""
NEIGHBOR_TURNS = 5
"""Number of turns on each side to compare with."""
_TACHOMETER_ADVICE = "Check the tachometer, the column and the number of pulses per turn."


def compute_speed_from_pulses(signal: Floats, sample_rate: float, pulses: int = 1) -> Floats:
    """Return the spindle speed at each sample (rpm), shape (n,), from a tachometer signal of any unit, shape (n,).

    The speed is constant from one turn to the next. It is NaN before the first turn, after the last, and where a pulse
    is missing. Its mean over time is the number of turns over their time.

    Parameters
    ----------
    signal : ndarray, shape (n,)
        Signal of the tachometer in any unit.
    sample_rate
        Sample rate (Hz).
    pulses
        Number of pulses per turn.

    Returns
    -------
    ndarray, shape (n,)
        Spindle speed (rpm).

    Raises
    ------
    ValueError
        For less than two turns, for irregular pulses, and for pulses < 1.

    Examples
    --------
    A pulse of 2 ms every 20 ms.

    >>> pulse = np.where(np.arange(2000) % 200 < 20, 5.0, 0.0)
    >>> np.unique(compute_speed_from_pulses(pulse, 10e3)[200:1600].round(3)).tolist()
    [3000.0]
    """
    if pulses < 1:
        raise ValueError(f"{pulses} pulses per turn are below 1")
    begins = _find_rising_edges(signal)
    marks = begins[::pulses]
    if marks.size < 3:
        found = f"{begins.size} pulses in {signal.size / sample_rate:.3g} s are less than two turns of {pulses}"
        raise ValueError(f"{found}. {_TACHOMETER_ADVICE}")
    turn = np.diff(marks)
    usual = np.array([np.median(turn[max(i - NEIGHBOR_TURNS, 0) : i + NEIGHBOR_TURNS + 1]) for i in range(turn.size)])
    is_even = np.maximum(turn / usual, usual / turn) < MAX_TURN_RATIO
    if np.mean(is_even) < MIN_REGULAR_TURNS_SHARE:
        raise ValueError(f"the {begins.size} tachometer pulses are irregular. {_TACHOMETER_ADVICE}")
    speed = np.full(signal.size, np.nan)
    edges = np.ceil(marks).astype(int)
    for first, last, time in zip(edges[:-1][is_even], edges[1:][is_even], turn[is_even], strict=True):
        speed[first:last] = 60 * sample_rate / time
    return speed


def _find_rising_edges(signal: Floats) -> Floats:
    """Find the starts of pulses, in samples and fractions of them."""
    low, high = float(np.min(signal)), float(np.max(signal))
    if not high > low:
        return np.empty(0)
    level = (signal - low) / (high - low)
    state = np.where(level > PULSE_ON_LEVEL, 1, np.where(level < PULSE_OFF_LEVEL, -1, 0))
    known = np.flatnonzero(state)
    rises = (state[known[1:]] > 0) & (state[known[:-1]] < 0)
    after, before = known[1:][rises], known[:-1][rises]
    share = (PULSE_ON_LEVEL - level[before]) / (level[after] - level[before])
    return np.asarray(before + share * (after - before), dtype=np.float64)


SPEED_ROLES = ("speed", "tacho")
"""Roles of a column of the spindle speed."""


def split_speed_column(signals: Sequence[Signal], report: ImportReport) -> tuple[list[Signal], Signal | None]:
    """Return the signals without the spindle speed, and the signal of the speed; None without one."""
    columns, pulses = [signal for signal in signals if signal.role in SPEED_ROLES], report.description.pulses
    if report.description.tacho:
        named = report.attempt(find_column, signals, report.description.tacho, "tacho")
        columns = [] if named is None else [named]
    if len(columns) > 1:
        names = ", ".join(signal.name for signal in columns)
        report.add_missing(f"choice of the spindle-speed column among {names}", "tacho", f' "{columns[0].name}"')
    rest = [signal for signal in signals if signal.role not in SPEED_ROLES and signal not in columns]
    if pulses is not None and not columns:
        report.reject("pulses", pulses, "no tachometer column", "Name the tachometer column with Description.tacho")
    return rest, columns[0] if columns else None


def resolve_speed(signal: Signal, sample_rate: float, report: ImportReport) -> Floats:
    """Return the spindle speed at each sample (rpm), NaN if unknown."""
    unit, values = parse_unit(signal.unit), np.asarray(signal.values, dtype=np.float64)
    pulses = report.description.pulses
    if unit is None or unit.quantity != "frequency":
        if signal.role == "speed":
            example = f' "speed [rpm]={signal.name}"'
            raise report.add_missing(f"unit of the spindle speed in column {signal.name!r}", "columns", example)
        try:
            return compute_speed_from_pulses(values, sample_rate, 1 if pulses is None else pulses)
        except ValueError as error:
            raise report.add_fault(f"{signal.name}: {error}") from error
    speed = np.abs(values) * (60 * unit.factor)
    if pulses is not None:
        raise report.reject_useless("pulses", pulses, f"{signal.name} is a speed in {signal.unit}, not a pulse signal")
    if not np.any(speed > 0):
        cure = "Choose another column of the speed, or omit this column"
        raise report.add_fault(f"spindle speed {signal.name} is always 0 {signal.unit}", cure)
    return np.where(speed > 0, speed, np.nan)


CUT_COLUMNS_EXAMPLE = ' "time [s],acceleration [m/s^2]"'
"""Example of the columns of a cut."""
MICROPHONE_SENSOR = "microphone"
"""Sensor whose values need no unit, because only their ratios count."""


def read_cut_recording(path: Path | str, description: Description = EMPTY_DESCRIPTION) -> CutSignal:
    """Read a cut recorded by accelerometers or a microphone, from a file of any known format.

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
        raise DataError(f"{path}: this is a {file_format.title}, not a recorded cut")
    report = ImportReport(description)
    signals = report.attempt(_resolve_cut_signals, contents)
    if signals is None:
        raise DataError(f"{path}: {report.format_problems()}")
    values, rate, speed = signals
    if not np.all(np.isfinite(values)):
        raise DataError(f"{path}: the signal has infinite or missing values. Export the file again.")
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
        fact = f"acceleration column (columns of the file: {format_signal_names(signals)})"
        raise report.add_missing(fact, "columns", CUT_COLUMNS_EXAMPLE)
    if description.response is not None:
        one = report.attempt(choose_signal, candidates, "responses")
        candidates = [] if one is None else [one]
    factors = [1.0 if is_microphone else report.attempt(_resolve_factor, signal) for signal in candidates]
    speed_signals = [speed_signal] if speed_signal is not None and candidates else []
    rate, used = resolve_rate(scaled, [*candidates, *speed_signals], report)
    if is_microphone and responses:
        report.add_fault(f"{responses[0].name} is a motion, not a sound", "Omit Description.sensor microphone")
    report.require_clean()
    speed = resolve_speed(used[-1], rate, report) if speed_signals else None
    values = np.stack([signal.values * factor for signal, factor in zip(used, factors, strict=False)])
    return np.asarray(values if len(factors) > 1 else values[0], dtype=np.float64), rate, speed


def _resolve_factor(signal: Signal, report: ImportReport) -> float:
    """Return the factor of an acceleration to m/s^2."""
    quantity, factor = resolve_response_unit(signal, report)
    if quantity != "acceleration":
        raise report.add_fault(f"{signal.name} is a {quantity}, but a recorded cut needs an acceleration")
    return factor
