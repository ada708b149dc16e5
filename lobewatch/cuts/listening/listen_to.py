"""What a recording of a cut says: stable, chatter, period two, or why that cannot be told.

The thresholds here and beside were chosen on simulated cuts, with other random numbers than those of the long tests
(docs/cuts.md, How often it is right).
"""

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
"""Least energy that the comb is taken to have, over that of what is left."""
SIDE_BANDS = 3
"""Number of lines of a family that is chatter for sure."""
FLIP = 0.003
"""Distance from half of tooth passing, relative to that, within which chatter has a period of two teeth."""
OTHER_TEETH = 5.0
"""Energy of the orders that run-out hardly has (modulo the teeth neither 0 nor +-1) over those it has ..."""
RUN_OUT = 8.0
"""... and of all orders that are no tooth passing over tooth passing, in less than a slot."""
SLOT = 0.95
"""Immersion from which on tooth passing nearly vanishes."""
NEAR = 1.0
"""Distance of a line at the end of a cut up to which it is that of the whole cut (bins)."""


@dataclass(frozen=True, eq=False)
class HeardSound:
    """What was heard in a recording, and what it rests on; None and NaN where it did not get so far."""

    word: CutWord
    """Word for what the cut sounded like."""
    reason: str
    """Code of why it cannot be told; empty where it can."""
    parts: CutParts
    """Parts of the recording that are the cut, and air."""
    turning: SpindleSpeed | None = None
    """True speed of the spindle."""
    ratio: float = np.nan
    """Energy of what is left, at the end of the cut, over that of the multiples of the spindle."""
    chatter: ChatterLines | None = None
    """Lines of chatter."""
    lines: SortedLines | None = None
    """All lines, by where they come from."""
    spectrum: Spectrum | None = None
    """Spectrum of the cut."""

    @property
    def speed_rpm(self) -> float:
        """True spindle speed (rpm); NaN where it was not found."""
        return np.nan if self.turning is None else 60 * self.turning.frequency


class CutRecording(NamedTuple):
    """A recording that is to be listened to."""

    signal: Floats
    """Acceleration of the housing (m/s^2), shape (n,)."""
    sample_rate: float
    """Sample rate (Hz)."""
    teeth: int
    """Number of teeth of the cutter."""
    immersion: float
    """Radial depth over diameter (-)."""
    commanded_rpm: float
    """Spindle speed as it was set (rpm)."""
    clipped: NDArray[np.bool_] | None = None
    """Overload of the sensor or its input, shape (n,); None: nowhere."""
    lost_scans: int = 0
    """Number of scans that are missing."""


def listen_to(recording: CutRecording) -> HeardSound:
    """Tell a recording of a cut, with some air before or after it.

    Reasons why it cannot be told: "too-short", "no-cut", "no-air", "two-cuts", "knock", "overload", "lost-scans",
    "speed-not-found", "on-spindle-lines" (period two of an even number of teeth, or chatter locked to the spindle),
    "faint".
    """
    signal, rate = np.asarray(recording.signal, dtype=np.float64), recording.sample_rate
    parts = find_cut(signal, rate, 60 / recording.commanded_rpm)
    reason = _fault(recording, parts)
    if reason:
        return HeardSound("cannot tell", reason, parts)
    spectrum, air = spectrum_of(signal[parts.cut], rate), spectrum_of(signal[parts.air], rate)
    lines, teeth = lines_of(spectrum), recording.teeth
    turning = true_speed(lines[~is_foreign(lines, air)], lines, spectrum, teeth, recording.commanded_rpm / 60)
    if turning is None:
        return HeardSound("cannot tell", "speed-not-found", parts, spectrum=spectrum)
    unsteady = unsteadiness(signal[parts.cut], rate, lines, turning, spectrum.bin)
    by_origin = sort_lines(lines, spectrum, air, turning, teeth, unsteady)
    return _judge_lines(HeardSound("stable", "", parts, turning, 0.0, None, by_origin, spectrum), recording)


def _fault(recording: CutRecording, parts: CutParts) -> str:
    """Why the signal cannot be trusted, a code; empty where it can."""
    if parts.reason == "too-short":
        return parts.reason
    if recording.clipped is not None and np.any(recording.clipped if parts.reason else recording.clipped[parts.cut]):
        return "overload"
    return "lost-scans" if recording.lost_scans else parts.reason


def _judge_lines(sound: HeardSound, recording: CutRecording) -> HeardSound:
    """The word on a cut whose lines are known."""
    lines, turning, spectrum = sound.lines, sound.turning, sound.spectrum
    if lines is None or turning is None or spectrum is None:
        raise ValueError("a cut whose lines are not known cannot be judged")
    if not len(lines.left):
        return _judge_without_chatter(sound, recording)
    tooth = turning.frequency * recording.teeth
    chatter = chatter_lines(lines.left, tooth, spectrum.bin)
    part = recording.signal[sound.parts.cut]
    end = spectrum_of(np.asarray(part[part.size // 2 :], dtype=np.float64), recording.sample_rate)
    still = min(float(end.loudest_near(np.array([chatter.frequency]), NEAR)[0]) / _power(chatter), 1.0)
    ratio = still * lines.left.energy / max(lines.comb.energy, LEAST_COMB * lines.left.energy)
    sound = replace(sound, ratio=ratio)
    if ratio < QUIET:
        return _judge_without_chatter(sound, recording)
    if ratio < (CHATTERS if len(chatter.lines) >= SIDE_BANDS else ALONE):
        return replace(sound, word="cannot tell", reason="faint")
    half = abs(chatter.frequency / tooth % 1 - 0.5) < FLIP
    return replace(sound, word="flip" if half else "chatter", chatter=chatter)


def _power(chatter: ChatterLines) -> float:
    """Power of the line that names it."""
    at = int(np.argmin(np.abs(chatter.lines.frequency - chatter.frequency)))
    return float(chatter.lines.amplitude[at] ** 2)


def _judge_without_chatter(sound: HeardSound, recording: CutRecording) -> HeardSound:
    """Stable, unless multiples of the spindle are louder than run-out and teeth make them."""
    if sound.lines is None:
        return sound
    power, order = sound.lines.comb.amplitude**2, sound.lines.tooth
    tooth, run_out = order == 0, (order == 1) | (order == recording.teeth - 1)
    uneven = float(np.sum(power[~run_out & ~tooth]))
    is_odd = uneven > OTHER_TEETH * float(np.sum(power[run_out & ~tooth])) and uneven > QUIET * float(np.sum(power))
    is_loud = recording.immersion < SLOT and float(np.sum(power[~tooth])) > RUN_OUT * float(np.sum(power[tooth]))
    return replace(sound, word="cannot tell", reason="on-spindle-lines") if is_odd or is_loud else sound


def line_kinds(sound: HeardSound) -> dict[str, SpectralLines]:
    """Lines that are there, under "turns" of the spindle, "tooth" passing, "air" (there without a cut), "chatter"."""
    lines, chatter = sound.lines, sound.chatter
    named: dict[str, SpectralLines] = {}
    if lines is not None:
        tooth = lines.tooth == 0
        named = {"turns": lines.comb[~tooth], "tooth": lines.comb[tooth], "air": lines.foreign}
    if chatter is not None:
        named["chatter"] = chatter.lines
    return {name: kind for name, kind in named.items() if len(kind)}
