"""What a recording of a cut says: stable, chatter, period two, or why that cannot be told."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lobewatch.cuts.listening.chatter_lines import ChatterLines, chatter_lines
from lobewatch.cuts.listening.find_cut import CutParts, find_cut
from lobewatch.cuts.listening.lattice import SpindleSpeed
from lobewatch.cuts.listening.sorted_lines import SortedLines, is_foreign, sort_lines
from lobewatch.cuts.listening.spectrum import Floats, SpectralLines, Spectrum, lines_of, spectrum_of
from lobewatch.cuts.listening.steadiness import unsteadiness
from lobewatch.cuts.listening.true_speed import true_speed
from lobewatch.machine.journal.heard_cut import CutWord

CHATTERS = 5e-4
"""Energy of what is left over that of the comb: above it, with side bands, a cut chatters ..."""
ALONE = 1e-2
"""... without side bands above this ..."""
QUIET = 2e-4
"""... and below this it is stable."""
LEAST_COMB = 1e-9
"""Of the energy of what is left, that the comb is taken to have at least."""
SIDE_BANDS = 3
"""Lines of a family that is chatter for sure."""
FLIP = 0.003
"""Nearer to half of tooth passing, relative to that, chatter has a period of two teeth."""
OTHER_TEETH = 5.0
"""Energy of the orders that run-out hardly has (modulo the teeth neither 0 nor +-1) over those it has ..."""
RUN_OUT = 8.0
"""... and of all orders that are no tooth passing over tooth passing, in less than a slot."""
SLOT = 0.95
"""Immersion from which on tooth passing nearly vanishes."""


@dataclass(frozen=True, eq=False)
class CutSound:
    """What was heard, and what it rests on; arrays are empty where it did not get so far."""

    word: CutWord
    """See CutWord."""
    reason: str
    """Why it cannot be told, a code; empty where it can."""
    parts: CutParts
    """Which part of the recording is the cut."""
    turning: SpindleSpeed | None = None
    """How fast the spindle turns."""
    ratio: float = np.nan
    """Energy of what is left, at the end of the cut, over that of the multiples of the spindle."""
    chatter: ChatterLines | None = None
    """The lines of chatter."""
    lines: SortedLines | None = None
    """All lines."""
    spectrum: Spectrum | None = None
    """Of the cut."""

    @property
    def speed_rpm(self) -> float:
        """True spindle speed (rpm); NaN where it was not found."""
        return np.nan if self.turning is None else 60 * self.turning.frequency


class CutRecording(NamedTuple):
    """A recording that is to be listened to."""

    signal: Floats
    """m/s^2, shape (n,)."""
    sample_rate: float
    """Hz."""
    teeth: int
    """Of the cutter."""
    immersion: float
    """Radial depth over diameter (-)."""
    commanded_rpm: float
    """Spindle speed as it was set (rpm)."""
    clipped: NDArray[np.bool_] | None = None
    """Where the sensor or its input was overloaded, shape (n,); None: nowhere."""
    lost_scans: int = 0
    """How many are missing."""


def listen_to(what: CutRecording) -> CutSound:
    """Tell a recording of a cut, with some air before or after it.

    Reasons why it cannot be told: "too-short", "no-cut", "no-air", "two-cuts", "knock", "overload", "lost-scans",
    "speed-not-found", "on-spindle-lines" (period two of an even number of teeth, or chatter locked to the spindle),
    "faint".
    """
    signal, rate = np.asarray(what.signal, dtype=np.float64), what.sample_rate
    parts = find_cut(signal, rate, 60 / what.commanded_rpm)
    reason = _fault(what, parts)
    if reason:
        return CutSound("cannot tell", reason, parts)
    spectrum, air = spectrum_of(signal[parts.cut], rate), spectrum_of(signal[parts.air], rate)
    every = lines_of(spectrum)
    turning = true_speed(every[~is_foreign(every, air)], every, spectrum, what.teeth, what.commanded_rpm / 60)
    if turning is None:
        return CutSound("cannot tell", "speed-not-found", parts, spectrum=spectrum)
    unsteady = unsteadiness(signal[parts.cut], rate, every, turning, spectrum.bin)
    lines = sort_lines(every, spectrum, air, turning, what.teeth, unsteady)
    found = CutSound("stable", "", parts, turning, 0.0, None, lines, spectrum)
    return _judged(found, what)


def _fault(what: CutRecording, parts: CutParts) -> str:
    """Why the signal cannot be trusted, a code; empty where it can."""
    if parts.reason == "too-short":
        return parts.reason
    if what.clipped is not None and np.any(what.clipped if parts.reason else what.clipped[parts.cut]):
        return "overload"
    return "lost-scans" if what.lost_scans else parts.reason


def _judged(found: CutSound, what: CutRecording) -> CutSound:
    """The word on a cut whose lines are known."""
    lines, turning, spectrum = found.lines, found.turning, found.spectrum
    if lines is None or turning is None or spectrum is None:
        raise ValueError("a cut whose lines are not known cannot be judged")
    if not len(lines.left):
        return _without_chatter(found, what)
    tooth = turning.frequency * what.teeth
    chatter = chatter_lines(lines.left, tooth, spectrum.bin)
    part = what.signal[found.parts.cut]
    end = spectrum_of(np.asarray(part[part.size // 2 :], dtype=np.float64), what.sample_rate)
    still = min(float(end.loudest_near(np.array([chatter.frequency]), 1.0)[0]) / _power(chatter), 1.0)
    ratio = still * lines.left.energy / max(lines.comb.energy, LEAST_COMB * lines.left.energy)
    found = replace(found, ratio=ratio)
    if ratio < QUIET:
        return _without_chatter(found, what)
    if ratio < (CHATTERS if len(chatter.lines) >= SIDE_BANDS else ALONE):
        return replace(found, word="cannot tell", reason="faint")
    half = abs(chatter.frequency / tooth % 1 - 0.5) < FLIP
    return replace(found, word="flip" if half else "chatter", chatter=chatter)


def _power(chatter: ChatterLines) -> float:
    """Of the line that names it."""
    at = int(np.argmin(np.abs(chatter.lines.frequency - chatter.frequency)))
    return float(chatter.lines.amplitude[at] ** 2)


def _without_chatter(found: CutSound, what: CutRecording) -> CutSound:
    """Stable, unless multiples of the spindle are louder than run-out and teeth make them."""
    if found.lines is None:
        return found
    power, order = found.lines.comb.amplitude**2, found.lines.tooth
    tooth, run_out = order == 0, (order == 1) | (order == what.teeth - 1)
    other = float(np.sum(power[~run_out & ~tooth]))
    is_odd = other > OTHER_TEETH * float(np.sum(power[run_out & ~tooth])) and other > QUIET * float(np.sum(power))
    is_loud = what.immersion < SLOT and float(np.sum(power[~tooth])) > RUN_OUT * float(np.sum(power[tooth]))
    return replace(found, word="cannot tell", reason="on-spindle-lines") if is_odd or is_loud else found


def line_kinds(heard: CutSound) -> dict[str, SpectralLines]:
    """Lines that are there, under "turns" of the spindle, "tooth" passing, "air" (there without a cut), "chatter"."""
    lines, chatter = heard.lines, heard.chatter
    named: dict[str, SpectralLines] = {}
    if lines is not None:
        tooth = lines.tooth == 0
        named = {"turns": lines.comb[~tooth], "tooth": lines.comb[tooth], "air": lines.foreign}
    if chatter is not None:
        named["chatter"] = chatter.lines
    return {name: one for name, one in named.items() if len(one)}
