"""Resolve the FRF in the contents of a recorded file."""

import itertools
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import get_args

import numpy as np

from acquisition.arrays import Complexes, Floats, Indices
from acquisition.files.contents.column_headings import ANGLE_UNITS, is_decibel
from acquisition.files.contents.contents import (
    Contents,
    ImportReport,
    Signal,
    UnresolvedError,
    cut_to_shortest,
    has_same_axis,
)
from acquisition.files.contents.resolve_unit import choose_signal, resolve_frf_unit
from acquisition.files.contents.two_sided import find_lower_half
from acquisition.files.contents.units import MOTION_QUANTITIES, parse_unit
from acquisition.frf import Frf, FrfQuantity, from_accelerance

FRF_COLUMNS_EXAMPLE = ' "frequency [Hz],real [m/N],imag" or "frequency [Hz],db [m/N],phase [deg]"'
"""Example of the columns of an FRF."""
FRF_FORM_BY_MOTION: dict[str, FrfQuantity] = dict(zip(MOTION_QUANTITIES, get_args(FrfQuantity), strict=True))
"""Form of an FRF by the quantity of its response."""
MAX_INVALID_COHERENCE_SHARE = 0.02
"""Share of the lines that may have a coherence outside 0 to 1, as the first lines of some analysers have."""
_HERTZ_NAMES = re.compile(r"f|hz|column \d+|(?!.*(ang|circ|omega|rad)).*freq.*", re.IGNORECASE)
"""Names of a frequency in Hz, and the name of a column without one."""
_ROUND_STEP_DIGITS, _ROUND_STEP_TOLERANCE = 5, 3e-7
"""Digits of a round step, and its relative tolerance: the last of seven printed digits."""


def find_frf_candidates(signals: Sequence[Signal]) -> list[list[Signal]]:
    """Find the FRFs among signals: complex ones, then real part or magnitude with its partner, in their order."""
    listed = [[signal] for signal in signals if signal.role == "frf"]
    for first, second in (("real", "imag"), ("magnitude", "phase")):
        seconds = (part for part in signals if part.role == second)
        listed += [[part, *itertools.islice(seconds, 1)] for part in signals if part.role == first]
    return listed


def resolve_frf(contents: Contents, report: ImportReport) -> Frf | None:
    """Return the FRF of contents with one or more; None if the report has faults or missing facts."""
    listed = find_frf_candidates(contents.signals)
    signal = report.attempt(choose_signal, [parts[0] for parts in listed], "FRFs")
    n_averages = _resolve_averages(contents, report)
    parts = next((parts for parts in listed if parts[0] is signal), listed[0])
    coherence = _find_coherence(contents, listed.index(parts), parts[0])
    axes = [axis for axis in contents.signals if axis.role == "frequency" and axis.record == parts[0].record]
    used, axes = cut_to_shortest([*parts, *([coherence] if coherence else [])], axes, report)
    parts = used[: len(parts)]
    _ask_for_level_and_angle(contents.signals, parts, report)
    values = report.attempt(_compute_complex_values, parts)
    unit = report.attempt(resolve_frf_unit, parts[0])
    frequency = report.attempt(_resolve_frequency, contents, parts, axes)
    shares = _resolve_coherence(used[-1] if coherence else None, report)
    report.add_flaws(parts, int(frequency is None or frequency[0] == 0))
    if frequency is None or values is None or unit is None or not report.is_clean:
        return None
    first = int(frequency[0] == 0 and not np.isfinite(values[0]))  # as analysers integrate an accelerance
    kept = _keep_lower_half(frequency, values, report)[first:]
    shares = None if shares is None else shares[kept]
    try:
        with np.errstate(invalid="ignore"):  # infinite values
            frf = _make_frf(frequency[kept], values[kept] * unit[1], shares, n_averages, FRF_FORM_BY_MOTION[unit[0]])
    except ValueError as error:
        report.add_fault(str(error), "Correct the file, or export the FRF again")
        return None
    _check_response(frf, report)
    return frf if report.is_clean else None


def _keep_lower_half(frequency: Floats, values: Complexes, report: ImportReport) -> Indices:
    """Return the lines to use: the lower half of a two-sided FRF, else all."""
    kept = find_lower_half(frequency, values)
    if kept.size < frequency.size:
        used = f"only {kept.size} lines up to {frequency[kept[-1]]:.6g} Hz used"
        report.add_fact("FRF", f"two-sided, {used} (the others are the mirror image)", "default")
    return kept


def _check_response(frf: Frf, report: ImportReport) -> None:
    """Report an FRF without any response to the force."""
    if not np.any(frf.receptance):
        report.add_fault("the FRF is zero on every line", "Check the sensor and its cable")
    elif frf.coherence is not None and not np.any(frf.coherence):
        found = "coherence is 0 on every line, so the response does not come from the hammer"
        report.add_fault(found, "Check the cables of hammer and sensor, or omit the coherence with Description.columns")


def _make_frf(
    frequency: Floats, values: Complexes, coherence: Floats | None, n_averages: int, form: FrfQuantity
) -> Frf:
    """Make an FRF from SI values of this form."""
    if form == "receptance":
        return Frf(frequency, values, coherence, n_averages)
    accelerance = values * (2j * np.pi * frequency) if form == "mobility" else values
    return replace(from_accelerance(frequency, accelerance, coherence, n_averages), measured_as=form)


def _compute_complex_values(parts: Sequence[Signal], report: ImportReport) -> Complexes:
    """Return the complex values in the unit of the file."""
    first, second = parts[0], parts[1] if len(parts) > 1 else None
    if first.role == "frf":
        if not np.iscomplexobj(first.values):
            report.add_fault(f"column {first.name} has real numbers, but the values of an FRF are complex")
        return first.values.astype(np.complex128)
    if second is None or second.values.shape != first.values.shape:
        fact = f"{'imaginary part' if first.role == 'real' else 'phase'} of column {first.name!r}"
        raise report.add_missing(fact, "columns", ' "frequency,real,imag" or "frequency,magnitude,phase"')
    if first.role == "real":
        if second.unit and not _is_same_unit(first.unit or second.unit, second.unit):
            units = f"{first.name} in {first.unit!r} and {second.name} in {second.unit!r}"
            raise report.add_fault(f"columns {units} differ in unit. Real and imaginary part must have the same unit")
        return np.asarray(first.values + 1j * second.values)
    angle = ANGLE_UNITS.get(second.unit.lower())
    if angle is None:
        raise UnresolvedError  # and asked for
    phase = np.deg2rad(second.values) if angle == "deg" else second.values
    size = 10 ** (first.values / 20) if is_decibel(first.unit) else first.values
    return np.asarray(size * np.exp(1j * phase))


def _ask_for_level_and_angle(signals: Sequence[Signal], parts: Sequence[Signal], report: ImportReport) -> None:
    """Ask for the unit of a phase, and of a magnitude that is probably a level, in one message."""
    if parts[0].role != "magnitude" or len(parts) < 2:
        return
    size, phase = parts
    may_be_level = not is_decibel(size.unit) and bool(np.any(size.values < 0))
    asked = [f"unit of column {size.name!r}, probably dB because it has negative values"] if may_be_level else []
    asked += [] if phase.unit.lower() in ANGLE_UNITS else ["unit of the phase"]
    if not asked:
        return
    likely = "deg" if np.ptp(phase.values) > 2 * math.pi else "rad"
    angle = phase.unit if phase.unit.lower() in ANGLE_UNITS else likely
    words = {"magnitude": "db" if may_be_level or is_decibel(size.unit) else "magnitude", "phase": f"phase [{angle}]"}
    used = [one for one in signals if one.role in ("frequency", "coherence") or one.name in (size.name, phase.name)]
    in_order = len(used) == len(signals) and not any(word == "-" or "=" in word for word in report.description.columns)
    columns = (words.get(one.role, one.role) + ("" if in_order else f"={one.name}") for one in used)
    report.add_missing(" and ".join(asked), "columns", f' "{",".join(columns)}"')


def _is_same_unit(one: str, other: str) -> bool:
    unit = parse_unit(one)
    return one == other if unit is None else unit == parse_unit(other)


def _resolve_frequency(
    contents: Contents, frf: Sequence[Signal], axes: Sequence[Signal], report: ImportReport
) -> Floats:
    """Return the frequencies of the lines (Hz)."""
    axis = next((signal for signal in axes if signal.values.size == frf[0].values.size), None)
    if axis is None:
        return _make_even_frequency(contents.signals, frf, report)
    report.add_flaws([axis])
    if report.description.spacing is not None or report.description.start is not None:
        reason = f"the file has its own frequencies ({axis.name})"
        raise report.add_fault(f"Omit Description.spacing and Description.start: {reason}")
    if not axis.unit and _is_angular(axis):
        example = f' "frequency [rad/s]={axis.name},..."'
        raise report.add_missing(f"unit of column {axis.name!r}, Hz or rad/s", "columns", example)
    unit = parse_unit(axis.unit or "Hz")
    if unit is None or unit.quantity != "frequency":
        raise report.add_fault(f"unit {axis.unit!r} of frequency {axis.name} is not one of Hz, kHz, rad/s")
    values = np.asarray(axis.values, dtype=np.float64) * unit.factor
    report.add_fact("lines", _format_lines(values.size, *(axis.values[[0, -1]] * unit.factor)))
    if not axis.unit:
        report.add_fact("frequency", "unit Hz assumed", "default")
    return values


def _is_angular(axis: Signal) -> bool:
    """Return whether a frequency without a unit may be in rad/s: by its name, or as its steps are round only in Hz."""
    values = np.asarray(axis.values.real, dtype=np.float64)
    step = float(values[-1] - values[0]) / max(values.size - 1, 1)
    return not _HERTZ_NAMES.fullmatch(axis.name.strip()) or (not _is_round(step) and _is_round(step / (2 * math.pi)))


def _is_round(step: float) -> bool:
    return step > 0 and abs(float(f"{step:.{_ROUND_STEP_DIGITS - 1}e}") / step - 1) < _ROUND_STEP_TOLERANCE


def _make_even_frequency(signals: Sequence[Signal], frf: Sequence[Signal], report: ImportReport) -> Floats:
    """Return the frequencies of the lines by the spacing in the description (Hz)."""
    n, step, start = frf[0].values.size, report.description.spacing, report.description.start or 0.0
    if step is None:
        fact, spacing = "frequencies of the lines", " 0.5 Description.start 0 in Hz"
        axis = next((signal.name for signal in signals if signal.role == "" and _may_be_axis(signal, n)), None)
        if axis is None:
            raise report.add_missing(fact, "spacing", spacing)
        columns = ",".join([f"frequency [Hz]={axis}", *(f"{part.role}={part.name}" for part in frf)])
        example = f' "{columns}", with [rad/s] for rad/s, or Description.spacing{spacing}'
        raise report.add_missing(fact, "columns", example)
    if not (np.isfinite(step) and step > 0 and np.isfinite(start) and start >= 0):
        fault = "the spacing must be above 0 Hz, the start at least 0 Hz"
        raise report.reject("spacing", f"{step:g}, Description.start {start:g}", fault)
    report.add_fact("lines", _format_lines(n, start, start + step * (n - 1)), "option")
    return np.asarray(start + step * np.arange(n), dtype=np.float64)


def _may_be_axis(signal: Signal, n: int) -> bool:
    values = signal.values
    return values.shape == (n,) and not np.iscomplexobj(values) and bool(np.all(np.diff(values) > 0))


def _format_lines(n: int, first: float, last: float) -> str:
    return f"{n}, {first:.4g} to {last:.6g} Hz"


def _find_coherence(contents: Contents, number: int, frf: Signal) -> Signal | None:
    """Return the coherence of the FRF of this number."""
    coherences = [signal for signal in contents.signals if signal.role == "coherence"]
    parallel = [signal for signal in coherences if has_same_axis(signal, frf)]
    if not parallel or (len(coherences) > 1 and number >= len(coherences)):
        return None
    return coherences[number] if len(coherences) > 1 and coherences[number] in parallel else parallel[0]


def _resolve_coherence(signal: Signal | None, report: ImportReport) -> Floats | None:
    """Return the values of a coherence, 0 at lines where it is outside 0 to 1."""
    if signal is None:
        report.add_fact("coherence", "none", "file")
        return None
    values = np.asarray(signal.values.real, dtype=np.float64)
    invalid = ~((values >= 0) & (values <= 1 + 1e-9))
    if np.mean(invalid) > MAX_INVALID_COHERENCE_SHARE:
        report.add_fact("coherence", f"{signal.name} omitted (outside 0 to 1 at {invalid.sum()} lines)")
        return None
    taken = f", set to 0 at {invalid.sum()} lines outside 0 to 1" if invalid.any() else ""
    report.add_fact("coherence", f"{signal.name}{taken}")
    return np.where(invalid, 0.0, values)


def _resolve_averages(contents: Contents, report: ImportReport) -> int:
    in_file, given = contents.averages, report.description.averages
    if given is not None and given < 1:
        report.reject("averages", given, "the number of averaged hits must be 1 or more")
    elif in_file is not None and given is not None and given != in_file:
        report.add_contradiction("averages", given, in_file)
    elif (averages := given if in_file is None else in_file) is not None:
        report.add_fact("averages", str(averages), "option" if in_file is None else "file")
        return averages
    else:
        report.add_fact("averages", "1 (change with Description.averages)", "default")
    return 1
