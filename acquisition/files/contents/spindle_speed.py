"""Spindle speed from a speed column or the pulses of a tachometer."""

from collections.abc import Sequence

import numpy as np

from acquisition.arrays import Floats
from acquisition.files.contents.column_headings import find_column
from acquisition.files.contents.contents import Signal
from acquisition.files.contents.description import ImportReport
from acquisition.files.contents.units import parse_unit

PULSE_ON_LEVEL, PULSE_OFF_LEVEL = 0.6, 0.4
"""Levels of the signal, as shares of its range, above which a pulse begins and below which it ends; chosen."""
MAX_TURN_RATIO = 1.4
"""Ratio of the time of a turn to that of its neighbours, or its inverse, from which pulses are missing or too many."""
MIN_REGULAR_TURNS_SHARE = 0.8
"""Smallest share of turns that are as long as their neighbours."""
NEIGHBOR_TURNS = 5
"""Number of turns on each side to compare with."""
_TACHOMETER_QUESTION = "is the tachometer connected, and is this its column?"


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
        raise ValueError(f"{pulses} pulses a turn; give 1 or more")
    begins = _find_rising_edges(signal)
    marks = begins[::pulses]
    if marks.size < 3:
        found = f"{begins.size} pulses in {signal.size / sample_rate:.3g} s, less than two turns of {pulses}"
        raise ValueError(f"{found}; {_TACHOMETER_QUESTION}")
    turn = np.diff(marks)
    usual = np.array([np.median(turn[max(i - NEIGHBOR_TURNS, 0) : i + NEIGHBOR_TURNS + 1]) for i in range(turn.size)])
    is_even = np.maximum(turn / usual, usual / turn) < MAX_TURN_RATIO
    if np.mean(is_even) < MIN_REGULAR_TURNS_SHARE:
        raise ValueError(f"{begins.size} pulses at no even times; {_TACHOMETER_QUESTION}")
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
        names = " and ".join(signal.name for signal in columns)
        report.add_missing(f"which of {names} is the speed of the spindle", "tacho", f' "{columns[0].name}"')
    rest = [signal for signal in signals if signal.role not in SPEED_ROLES and signal not in columns]
    if pulses is not None and not columns:
        report.reject("pulses", pulses, "no column is a tachometer; name it with Description.tacho")
    return rest, columns[0] if columns else None


def resolve_speed(signal: Signal, sample_rate: float, report: ImportReport) -> Floats:
    """Return the spindle speed at each sample (rpm), NaN where unknown."""
    unit, values = parse_unit(signal.unit), np.asarray(signal.values, dtype=np.float64)
    if unit is not None and unit.quantity == "frequency":
        return _convert_speed(signal, values, 60 * unit.factor, report)
    if signal.role == "speed":
        raise report.add_missing(f"the unit of the speed in {signal.name}", "columns", f' "speed [rpm]={signal.name}"')
    pulses = report.description.pulses
    try:
        return compute_speed_from_pulses(values, sample_rate, 1 if pulses is None else pulses)
    except ValueError as error:
        raise report.add_fault(f"{signal.name}: {error}") from error


def _convert_speed(signal: Signal, values: Floats, factor: float, report: ImportReport) -> Floats:
    """Convert a speed with a factor (rpm per unit)."""
    pulses, speed = report.description.pulses, np.abs(values) * factor
    if pulses is not None:
        raise report.reject("pulses", pulses, f"{signal.name} is the speed itself ({signal.unit}); leave it out")
    if not np.any(speed > 0):
        fault = f"stands at 0 {signal.unit} all along; name another column, or leave it out"
        raise report.add_fault(f"{signal.name}: {fault}")
    return np.where(speed > 0, speed, np.nan)
