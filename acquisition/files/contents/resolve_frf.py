"""Resolve the FRF in the contents of a recorded file."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from acquisition.arrays import Complexes, Floats
from acquisition.files.contents.column_headings import ANGLE_UNITS, is_decibel
from acquisition.files.contents.contents import Contents, Signal, cut_to_shortest, has_same_axis, report_flaws
from acquisition.files.contents.description import Description, ImportReport
from acquisition.files.contents.resolve_unit import choose_signal, resolve_frf_unit
from acquisition.files.contents.units import parse_unit
from acquisition.frf import Frf, FrfQuantity, from_accelerance

_HERTZ_NAMES = re.compile(r"f|hz|column \d+|(?!.*(ang|circ|omega|rad)).*freq.*", re.IGNORECASE)
"""Names of a frequency proper, and that of a column that has none."""
_ROUND_STEP_DIGITS, _ROUND_STEP_TOLERANCE = 5, 3e-7
"""Digits of a round step, and how far, relative, one may be off that: the last of seven printed digits."""


def is_angular(axis: Signal) -> bool:
    """Whether it may be."""
    values = np.asarray(axis.values.real, dtype=np.float64)
    step = float(values[-1] - values[0]) / max(values.size - 1, 1)
    return not _HERTZ_NAMES.fullmatch(axis.name.strip()) or (not _is_round(step) and _is_round(step / (2 * math.pi)))


def _is_round(step: float) -> bool:
    return step > 0 and abs(float(f"{step:.{_ROUND_STEP_DIGITS - 1}e}") / step - 1) < _ROUND_STEP_TOLERANCE


FRF_COLUMNS_EXAMPLE = '--columns "frequency [Hz],real [m/N],imag", in their order, or each with =NAME'
"""How an FRF is named."""
FRF_FORM_BY_MOTION: dict[str, FrfQuantity] = {
    "displacement": "receptance",
    "velocity": "mobility",
    "acceleration": "accelerance",
}


@dataclass(frozen=True, eq=False)
class FrfCandidate:
    """One FRF of a file, in the unit of the file."""

    signal: Signal
    """Signal that names it: the complex values, the real part or the magnitude."""
    partner: Signal | None = None
    """The imaginary part or the phase."""

    def format_columns_option(self) -> str:
        """Its columns as `--columns` names them."""
        return ",".join(f"{part.role}={part.name}" for part in self.parts)

    @property
    def parts(self) -> list[Signal]:
        """The one or two signals."""
        return [self.signal] if self.partner is None else [self.signal, self.partner]


def find_frf_candidates(signals: Sequence[Signal]) -> list[FrfCandidate]:
    """The FRFs among signals: complex ones, and pairs in their order."""
    listed = [FrfCandidate(signal) for signal in signals if signal.role == "frf"]
    for first, second in (("real", "imag"), ("magnitude", "phase")):
        seconds: Iterator[Signal | None] = iter([part for part in signals if part.role == second])
        listed += [FrfCandidate(part, next(seconds, None)) for part in signals if part.role == first]
    return listed


def resolve_frf(contents: Contents, description: Description, report: ImportReport) -> Frf | None:
    """The FRF; None where something is missing or wrong, which the report then says."""
    listed = find_frf_candidates(contents.signals)
    if not listed:
        report.add_missing("what its columns are", FRF_COLUMNS_EXAMPLE)
        return None
    signal = choose_signal([candidate.signal for candidate in listed], description.response, "FRFs", report)
    n_averages = _resolve_averages(contents, description, report)
    candidate = next((candidate for candidate in listed if candidate.signal is signal), listed[0])
    coherence = _find_coherence(contents, listed.index(candidate), candidate.signal)
    axes = [axis for axis in contents.signals if axis.role == "frequency" and axis.record == candidate.signal.record]
    used, axes = cut_to_shortest([*candidate.parts, *([coherence] if coherence else [])], axes, report)
    candidate = FrfCandidate(*used[: len(candidate.parts)])
    values = _compute_complex_values(candidate, report)
    unit = resolve_frf_unit(candidate.signal, description, report)
    frequency = _resolve_frequency(contents, candidate, axes, description, report)
    shares = _resolve_coherence(used[-1] if coherence else None, report)
    report_flaws(candidate.parts, report, int(frequency is None or frequency[0] == 0))
    if frequency is None or values is None or unit is None or not report.is_clean:
        return None
    first = int(frequency[0] == 0 and not np.isfinite(values[0]))  # as analysers integrate an accelerance
    shares = None if shares is None else shares[first:]
    try:
        return _make_frf(frequency[first:], values[first:] * unit[1], shares, n_averages, FRF_FORM_BY_MOTION[unit[0]])
    except ValueError as error:
        report.faults.append(str(error))
        return None


def _make_frf(
    frequency: Floats,
    values: Complexes,
    coherence: Floats | None,
    n_averages: int,
    form: FrfQuantity,
) -> Frf:
    """values: in SI, of the form that they have in the file."""
    if form == "receptance":
        return Frf(frequency, values, coherence, n_averages)
    if form == "mobility":
        receptance = from_accelerance(frequency, values * (2j * np.pi * frequency), coherence, n_averages)
        return replace(receptance, measured_as="mobility")
    return from_accelerance(frequency, values, coherence, n_averages)


def _compute_complex_values(candidate: FrfCandidate, report: ImportReport) -> Complexes | None:
    """Complex values in the unit of the file."""
    first, second = candidate.signal, candidate.partner
    if first.role == "frf":
        if not np.iscomplexobj(first.values):
            report.faults.append(f"{first.name} holds real numbers; an FRF is complex")
        return first.values.astype(np.complex128)
    if second is None or second.values.shape != first.values.shape:
        partner = "imaginary part" if first.role == "real" else "phase"
        report.add_missing(
            f"the {partner} of {first.name}", '--columns "frequency,real,imag" or "frequency,magnitude,phase"'
        )
        return None
    if first.role == "real" and second.unit and not _is_same_unit(first.unit or second.unit, second.unit):
        report.faults.append(
            f"{first.name} is in {first.unit!r}, {second.name} in {second.unit!r}; they must be the same"
        )
        return None
    if first.role == "real":
        return np.asarray(first.values + 1j * second.values)
    angle = ANGLE_UNITS.get(second.unit.lower(), "")
    if not angle:
        report.add_missing("the unit of its phase", '--columns "frequency,magnitude,phase [deg]"')
        return None
    phase = np.deg2rad(second.values) if angle == "deg" else second.values
    if not is_decibel(first.unit) and np.any(first.values < 0):
        report.add_missing(
            f"whether {first.name}, which falls below 0, is in dB", '--columns "frequency,db,phase [deg]"'
        )
        return None
    size = 10 ** (first.values / 20) if is_decibel(first.unit) else first.values
    return np.asarray(size * np.exp(1j * phase))


def _is_same_unit(one: str, other: str) -> bool:
    known = parse_unit(one)
    return one == other if known is None else known == parse_unit(other)


def _make_even_frequency(
    signals: Sequence[Signal], frf: FrfCandidate, description: Description, report: ImportReport
) -> Floats | None:
    """Frequencies of the lines of an FRF (Hz), as a person says."""
    n, step, start = frf.signal.values.size, description.spacing, description.start or 0.0
    if step is None:
        axis = next((signal.name for signal in signals if signal.role == "" and _may_be_axis(signal, n)), None)
        by_name = f'--columns "frequency [Hz]={axis},{frf.format_columns_option()}", or [rad/s]; or ' if axis else ""
        report.add_missing("the frequencies of its lines", f"{by_name}--spacing 0.5 --start 0 in Hz")
        return None
    if not (np.isfinite(step) and step > 0 and np.isfinite(start) and start >= 0):
        report.faults.append(f"--spacing {step:g}, --start {start:g}: give a spacing > 0 Hz and a start >= 0 Hz")
        return None
    report.add_fact("lines", f"{n}, {start:.4g} to {start + step * (n - 1):.6g} Hz", "option")
    return np.asarray(start + step * np.arange(n), dtype=np.float64)


def _may_be_axis(signal: Signal, n: int) -> bool:
    return (
        signal.values.shape == (n,) and not np.iscomplexobj(signal.values) and bool(np.all(np.diff(signal.values) > 0))
    )


def _resolve_frequency(
    contents: Contents, frf: FrfCandidate, axes: Sequence[Signal], description: Description, report: ImportReport
) -> Floats | None:
    """Of an FRF (Hz)."""
    axis = next((signal for signal in axes if signal.values.size == frf.signal.values.size), None)
    if axis is None:
        return _make_even_frequency(contents.signals, frf, description, report)
    report_flaws([axis], report)
    if description.spacing is not None or description.start is not None:
        report.faults.append(f"--spacing, --start: the file holds its frequencies, {axis.name}; leave them out")
        return None
    if not axis.unit and is_angular(axis):
        report.add_missing(f"the unit of {axis.name}, Hz or rad/s", f'--columns "frequency [rad/s]={axis.name},..."')
        return None
    unit = parse_unit(axis.unit) if axis.unit else None
    if axis.unit and (unit is None or unit.quantity != "frequency"):
        report.faults.append(f"the frequency is in {axis.unit!r}; Hz, kHz and rad/s are known")
        return None
    report.add_fact("lines", f"{axis.values.size}, {_format_range(axis, unit.factor if unit else 1.0)}")
    if unit is None:
        report.add_fact("frequency", "in Hz", "default")
    return np.asarray(axis.values, dtype=np.float64) * (unit.factor if unit else 1.0)


def _format_range(axis: Signal, factor: float) -> str:
    return f"{axis.values[0] * factor:.4g} to {axis.values[-1] * factor:.6g} Hz"


def _find_coherence(contents: Contents, number: int, frf: Signal) -> Signal | None:
    """That of the FRF of this number."""
    coherences = [signal for signal in contents.signals if signal.role == "coherence"]
    beside = [signal for signal in coherences if has_same_axis(signal, frf)]
    if not beside or (len(coherences) > 1 and number >= len(coherences)):
        return None
    return coherences[number] if len(coherences) > 1 and coherences[number] in beside else beside[0]


def _resolve_coherence(signal: Signal | None, report: ImportReport) -> Floats | None:
    """Values of a coherence; a line where it lies beyond 0 to 1 is trusted with nothing."""
    if signal is None:
        report.add_fact("coherence", "none", "file")
        return None
    values = np.asarray(signal.values.real, dtype=np.float64)
    beyond = ~((values >= 0) & (values <= 1 + 1e-9))
    if np.mean(beyond) > MAX_INVALID_COHERENCE_SHARE:
        report.add_fact("coherence", f"{signal.name} is beyond 0 to 1 at {beyond.sum()} lines: left out")
        return None
    taken = f"; beyond 0 to 1 at {beyond.sum()} lines, there taken as 0" if beyond.any() else ""
    report.add_fact("coherence", f"{signal.name}{taken}")
    return np.where(beyond, 0.0, values)


MAX_INVALID_COHERENCE_SHARE = 0.02
"""Share of the lines that may have a coherence that is none, as the first lines of some analysers have."""


def _resolve_averages(contents: Contents, description: Description, report: ImportReport) -> int:
    if description.averages is not None and description.averages < 1:
        report.faults.append(f"--averages {description.averages}: give the number of hits averaged, 1 or more")
    elif None not in (description.averages, contents.averages) and description.averages != contents.averages:
        report.add_contradiction("--averages", description.averages, contents.averages)
    elif contents.averages is not None:
        report.add_fact("averages", str(contents.averages))
        return contents.averages
    elif description.averages is not None:
        report.add_fact("averages", str(description.averages), "option")
        return description.averages
    else:
        report.add_fact("averages", "1 (--averages)", "default")
    return 1
