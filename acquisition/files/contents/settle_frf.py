"""The FRF in what a file holds and what a person adds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquisition.files.contents.contents import Contents, Signal
from acquisition.files.contents.description import Description
from acquisition.files.contents.heading import ANGLES, is_level
from acquisition.files.contents.ledger import Ledger
from acquisition.files.contents.settle_unit import chosen, frf_unit
from acquisition.files.contents.units import unit_of
from acquisition.frf import Frf, Quantity, from_accelerance

COLUMNS_FRF = '--columns "frequency,real,imag", in their order, or each with =NAME'
"""How an FRF is named."""
FORMS: dict[str, Quantity] = {"displacement": "receptance", "velocity": "mobility", "acceleration": "accelerance"}


@dataclass(frozen=True, eq=False)
class Candidate:
    """One FRF of a file, in the unit of the file."""

    signal: Signal
    """Signal that names it: the complex values, the real part or the magnitude."""
    partner: Signal | None = None
    """The imaginary part or the phase."""


def candidates(signals: Sequence[Signal]) -> list[Candidate]:
    """The FRFs among signals: complex ones, and pairs in their order."""
    found = [Candidate(signal) for signal in signals if signal.role == "frf"]
    for first, second in (("real", "imag"), ("magnitude", "phase")):
        seconds: Iterator[Signal | None] = iter([one for one in signals if one.role == second])
        found += [Candidate(one, next(seconds, None)) for one in signals if one.role == first]
    return found


def settle_frf(contents: Contents, said: Description, ledger: Ledger) -> Frf | None:
    """The FRF; None where something is missing or wrong, which the ledger then says."""
    known = candidates(contents.signals)
    if not known:
        ledger.ask("what its columns are", COLUMNS_FRF)
        return None
    one = chosen([candidate.signal for candidate in known], said.response, "FRFs", ledger)
    n_averages = _averages(contents, said, ledger)
    if one is None:
        frf_unit(known[0].signal, said, ledger)
        return None
    candidate = next(candidate for candidate in known if candidate.signal is one)
    values = _values(candidate, ledger)
    unit = frf_unit(one, said, ledger)
    frequency = _frequency(contents, one, ledger)
    coherence = _coherence(contents, known.index(candidate), candidate.signal, ledger)
    if frequency is None or values is None or unit is None or not ledger.is_clean:
        return None
    try:
        return _frf(frequency, values * unit[1], coherence, n_averages, FORMS[unit[0]])
    except ValueError as error:
        ledger.faults.append(str(error))
        return None


def _frf(
    frequency: NDArray[np.float64],
    values: NDArray[np.complex128],
    coherence: NDArray[np.float64] | None,
    n_averages: int,
    form: Quantity,
) -> Frf:
    """values: in SI, of the form that they have in the file."""
    if form == "receptance":
        return Frf(frequency, values, coherence, n_averages)
    if form == "mobility":
        found = from_accelerance(frequency, values * (2j * np.pi * frequency), coherence, n_averages)
        return replace(found, measured_as="mobility")
    return from_accelerance(frequency, values, coherence, n_averages)


def _values(candidate: Candidate, ledger: Ledger) -> NDArray[np.complex128] | None:
    """Complex values in the unit of the file."""
    first, second = candidate.signal, candidate.partner
    if first.role == "frf":
        if not np.iscomplexobj(first.values):
            ledger.faults.append(f"{first.name} holds real numbers; an FRF is complex")
        return first.values.astype(np.complex128)
    if second is None or second.values.shape != first.values.shape:
        partner = "imaginary part" if first.role == "real" else "phase"
        ledger.ask(f"the {partner} of {first.name}", '--columns "frequency,real,imag" or "frequency,magnitude,phase"')
        return None
    if first.role == "real" and second.unit and unit_of(second.unit) != unit_of(first.unit or second.unit):
        ledger.faults.append(
            f"{first.name} is in {first.unit!r}, {second.name} in {second.unit!r}; they must be the same"
        )
        return None
    if first.role == "real":
        return np.asarray(first.values + 1j * second.values)
    angle = ANGLES.get(second.unit.lower(), "")
    if not angle:
        ledger.ask("the unit of its phase", '--columns "frequency,magnitude,phase [deg]"')
        return None
    phase = np.deg2rad(second.values) if angle == "deg" else second.values
    size = 10 ** (first.values / 20) if is_level(first.unit) else first.values
    return np.asarray(size * np.exp(1j * phase))


def _frequency(contents: Contents, one: Signal, ledger: Ledger) -> NDArray[np.float64] | None:
    """Of an FRF (Hz)."""
    axes = [signal for signal in contents.signals if signal.role == "frequency" and signal.record == one.record]
    axis = next((signal for signal in axes if signal.values.size == one.values.size), None)
    if axis is None:
        ledger.ask(f"the frequency of each of the {one.values.size} lines of {one.name}", '--columns "frequency,..."')
        return None
    unit = unit_of(axis.unit) if axis.unit else None
    if axis.unit and (unit is None or unit.quantity != "frequency"):
        ledger.faults.append(f"the frequency is in {axis.unit!r}; Hz, kHz and rad/s are known")
        return None
    ledger.know("lines", f"{axis.values.size}, {_ends(axis, unit.factor if unit else 1.0)}")
    if unit is None:
        ledger.know("frequency", "in Hz", "default")
    return np.asarray(axis.values, dtype=np.float64) * (unit.factor if unit else 1.0)


def _ends(axis: Signal, factor: float) -> str:
    return f"{axis.values[0] * factor:.4g} to {axis.values[-1] * factor:.6g} Hz"


def _coherence(contents: Contents, number: int, one: Signal, ledger: Ledger) -> NDArray[np.float64] | None:
    """That of the FRF of this number; a line where it lies beyond 0 to 1 is trusted with nothing."""
    found = [signal for signal in contents.signals if signal.role == "coherence"]
    same = [signal for signal in found if signal.record == one.record and signal.values.shape == one.values.shape]
    if not same or (len(found) > 1 and number >= len(found)):
        ledger.know("coherence", "none", "file")
        return None
    signal = found[number] if len(found) > 1 and found[number] in same else same[0]
    values = np.asarray(signal.values.real, dtype=np.float64)
    beyond = ~((values >= 0) & (values <= 1 + 1e-9))
    if np.mean(beyond) > MOST_BEYOND:
        ledger.know("coherence", f"{signal.name} is beyond 0 to 1 at {beyond.sum()} lines: left out")
        return None
    taken = f"; beyond 0 to 1 at {beyond.sum()} lines, there taken as 0" if beyond.any() else ""
    ledger.know("coherence", f"{signal.name}{taken}")
    return np.where(beyond, 0.0, values)


MOST_BEYOND = 0.02
"""Share of the lines that may have a coherence that is none, as the first lines of some analysers have."""


def _averages(contents: Contents, said: Description, ledger: Ledger) -> int:
    if said.averages is not None and said.averages < 1:
        ledger.faults.append(f"--averages {said.averages}: give the number of hits averaged, 1 or more")
    elif None not in (said.averages, contents.averages) and said.averages != contents.averages:
        ledger.contradict("--averages", said.averages, contents.averages)
    elif contents.averages is not None:
        ledger.know("averages", str(contents.averages))
        return contents.averages
    elif said.averages is not None:
        ledger.know("averages", str(said.averages), "option")
        return said.averages
    else:
        ledger.know("averages", "1 (--averages)", "default")
    return 1
