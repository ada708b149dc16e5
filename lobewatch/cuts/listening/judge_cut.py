"""The word on one cut, of arrays: stable, chatter, period two, or why that cannot be told.

The thresholds here and beside were chosen on simulated cuts, with other random numbers than those of the long tests
(docs/cuts.md, How often it is right).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lobewatch.cuts.listening.chatter_lines import ChatterLines, chatter_lines, has_side_bands
from lobewatch.cuts.listening.find_cut import UNPLACED, CutParts
from lobewatch.cuts.listening.fold_frequency import fold_frequency
from lobewatch.cuts.listening.lattice import SpindleSpeed
from lobewatch.cuts.listening.measured_speed import measured_speed
from lobewatch.cuts.listening.sorted_lines import (
    TOOTH_HARMONICS,
    WIDE,
    SortedLines,
    is_slow,
    lines_of_cut,
    sort_lines,
    with_tones,
)
from lobewatch.cuts.listening.spectrum import (
    Floats,
    SpectralLines,
    Spectrum,
    lines_of,
    spectra_of,
    spectrum_of,
    without_skirts,
)
from lobewatch.cuts.listening.speed_elsewhere import speed_elsewhere
from lobewatch.cuts.listening.steadiness import unsteadiness
from lobewatch.cuts.listening.true_speed import speed_of_spectra
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
    parts: CutParts = UNPLACED
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
    elsewhere_rpm: float = np.nan
    """Speed further from the one that was set that the lines fit (rpm); NaN without one, or where one is near."""
    tone: float = np.nan
    """Frequency of a tone that nothing explains (Hz); NaN where that is not the reason."""
    axis: int = 0
    """Which of several axes the word rests on, from 0."""
    measured_rpm: float | None = None
    """Speed by the tachometer in the cut (rpm), NaN where it gave none there; None without a tachometer."""

    @property
    def speed_rpm(self) -> float:
        """True spindle speed (rpm); NaN where it was not found."""
        return np.nan if self.turning is None else 60 * self.turning.frequency


def judge_cut(
    cut: Floats,
    air: Floats,
    sample_rate: float,
    teeth: int,
    immersion: float,
    commanded_rpm: float,
    measured_rpm: float | None = None,
) -> HeardSound:
    """The word on the steady part of a cut; cut and air in any unit, shape (n,) or (axes, n), sample_rate in Hz.

    air: the same spindle turning without a cut, n = 0 where there is none; immersion: radial depth over diameter;
    commanded_rpm as it was set; measured_rpm by a tachometer, which the lines must not contradict
    ("tacho-contradicts"); None without one. All axes have one speed, and the word is that of the loudest evidence: of
    the axis with the loudest chatter, else of that with the loudest cut. Reasons why it cannot be told:
    "speed-not-found", "no-air" (also where only lines that are there in air make a speed, which is named),
    "on-spindle-lines" (period two of an even number of teeth, or chatter locked to the spindle), "faint",
    "unexplained-tone" (a line without side bands), "slow-sampling" (fewer than three multiples of tooth passing are
    heard, folded ones too).

    Example: tooth passing of four teeth at 6000 rpm, its multiples and a little noise.

    >>> time, random = np.arange(10_000) / 10e3, np.random.default_rng(0)
    >>> comb = sum(np.sin(2 * np.pi * 400 * k * time) / k for k in range(1, 9))
    >>> air, cut = 0.01 * random.normal(size=(2, time.size)) + [[0.0], [1.0]] * comb
    >>> heard = judge_cut(cut, air, 10e3, 4, 0.5, 6020.0)
    >>> heard.word, round(heard.speed_rpm)
    ('stable', 6000)
    """
    spectra = spectra_of(cut, sample_rate)
    if not air.shape[-1]:
        return replace(_without_air(spectra, teeth, commanded_rpm / 60), reason="no-air")
    quiet = spectra_of(air, sample_rate)
    is_measured = measured_rpm is not None and bool(np.isfinite(measured_rpm))
    turning = _speed_or_reason(spectra, quiet, teeth, commanded_rpm / 60, measured_rpm if is_measured else None)
    if isinstance(turning, HeardSound):
        return turning
    axes = zip(np.atleast_2d(cut), np.atleast_2d(air), spectra, quiet, strict=True)
    sounds = [replace(_judge_axis(*axis, turning, teeth, immersion), axis=number) for number, axis in enumerate(axes)]
    sound = max(sounds, key=_evidence)
    if is_measured or sound.word == "stable" or sound.lines is None or not len(sound.lines.left):
        return sound
    elsewhere = 60 * speed_elsewhere(spectra, quiet, teeth, commanded_rpm / 60, turning, sound.lines.left)
    return sound if np.isnan(elsewhere) else _not_found(spectra[0], elsewhere)


def _judge_axis(
    cut: Floats, air: Floats, spectrum: Spectrum, quiet: Spectrum, turning: SpindleSpeed, teeth: int, immersion: float
) -> HeardSound:
    """The word on an axis; a tone alone is looked for in pieces of the air too."""
    lines = without_skirts(lines_of(spectrum), spectrum.bin)
    unsteady = unsteadiness(cut, spectrum.sample_rate, lines, turning, spectrum.bin)
    by_origin = sort_lines(lines, spectrum, quiet, turning, teeth, unsteady)
    sound = HeardSound("stable", "", turning=turning, ratio=0.0, lines=by_origin, spectrum=spectrum)
    judged = _judge_lines(sound, cut, teeth, immersion)
    if judged.reason != "unexplained-tone":
        return judged
    tones = with_tones(quiet, air, by_origin.left.frequency)
    by_origin = sort_lines(lines, spectrum, tones, turning, teeth, unsteady)
    return _judge_lines(replace(sound, lines=by_origin), cut, teeth, immersion)


def _speed_or_reason(
    spectra: Sequence[Spectrum], quiet: Sequence[Spectrum], teeth: int, commanded: float, measured_rpm: float | None
) -> SpindleSpeed | HeardSound:
    """The speed of the spindle, or the sound of a cut in which it is not known; commanded in Hz."""
    if measured_rpm is None:
        turning = speed_of_spectra(spectra, quiet, teeth, commanded)
        if turning is not None:
            return turning
        elsewhere = 60 * speed_elsewhere(spectra, quiet, teeth, commanded, None)
        return _not_found(spectra[0], elsewhere) if np.isfinite(elsewhere) else _without_air(spectra, teeth, commanded)
    turning, other = measured_speed(spectra, quiet, teeth, commanded, measured_rpm / 60)
    if np.isfinite(other):
        return HeardSound("cannot tell", "tacho-contradicts", spectrum=spectra[0], elsewhere_rpm=60 * other)
    return turning or _not_found(spectra[0], np.nan)


def _without_air(spectra: Sequence[Spectrum], teeth: int, commanded: float) -> HeardSound:
    """What is told where nothing is known of air, or where it sounds as the cut does: the speed, and no word."""
    silence = [replace(spectrum, power=np.zeros(spectrum.power.size)) for spectrum in spectra]
    turning = speed_of_spectra(spectra, silence, teeth, commanded)
    if turning is None:
        return _not_found(spectra[0], np.nan)
    lines = lines_of_cut(spectra, silence)
    beside = lines[fold_frequency(lines.frequency, turning.frequency) > WIDE * spectra[0].bin]
    elsewhere = 60 * speed_elsewhere(spectra, silence, teeth, commanded, turning, beside) if len(beside) else np.nan
    if np.isfinite(elsewhere):
        return _not_found(spectra[0], elsewhere)
    return HeardSound("cannot tell", "no-air", turning=turning, spectrum=spectra[0])


def _not_found(spectrum: Spectrum, elsewhere: float) -> HeardSound:
    """Of a speed that is not near the one that was set; elsewhere: that which the lines fit (rpm), NaN without one."""
    return HeardSound("cannot tell", "speed-not-found", spectrum=spectrum, elsewhere_rpm=elsewhere)


def _evidence(sound: HeardSound) -> tuple[bool, float]:
    """What the word rests on: chatter before anything else, then how loud it is."""
    if sound.lines is None:
        return False, 0.0
    if sound.chatter is not None:
        return True, sound.chatter.lines.energy
    return False, sound.lines.comb.energy


def _judge_lines(sound: HeardSound, signal: Floats, teeth: int, immersion: float) -> HeardSound:
    """The word on an axis whose lines are known."""
    lines, turning, spectrum = sound.lines, sound.turning, sound.spectrum
    if lines is None or turning is None or spectrum is None:
        raise ValueError("a cut whose lines are not known cannot be judged")
    if is_slow(spectrum, turning, teeth) and np.count_nonzero(lines.tooth == 0) + len(lines.folded) < TOOTH_HARMONICS:
        return replace(sound, word="cannot tell", reason="slow-sampling")
    if not len(lines.left):
        return _judge_without_chatter(sound, teeth, immersion)
    tooth = turning.frequency * teeth
    chatter = chatter_lines(lines.left, tooth, spectrum.bin)
    end = spectrum_of(signal[signal.size // 2 :], spectrum.sample_rate)
    still = min(float(end.loudest_near(np.array([chatter.frequency]), NEAR)[0]) / _power(chatter), 1.0)
    ratio = still * lines.left.energy / max(lines.comb.energy, LEAST_COMB * lines.left.energy)
    sound = replace(sound, ratio=ratio)
    if ratio < QUIET:
        return _judge_without_chatter(sound, teeth, immersion)
    if ratio < (CHATTERS if len(chatter.lines) >= SIDE_BANDS else ALONE):
        return replace(sound, word="cannot tell", reason="faint")
    if not has_side_bands(lines.left, chatter, turning.frequency, spectrum.bin):
        return replace(sound, word="cannot tell", reason="unexplained-tone", tone=chatter.frequency)
    half = abs(chatter.frequency / tooth % 1 - 0.5) < FLIP
    return replace(sound, word="flip" if half else "chatter", chatter=chatter)


def _power(chatter: ChatterLines) -> float:
    """Power of the line that names it."""
    at = int(np.argmin(np.abs(chatter.lines.frequency - chatter.frequency)))
    return float(chatter.lines.amplitude[at] ** 2)


def _judge_without_chatter(sound: HeardSound, teeth: int, immersion: float) -> HeardSound:
    """Stable, unless multiples of the spindle are louder than run-out and teeth make them."""
    if sound.lines is None:
        return sound
    power, order = sound.lines.comb.amplitude**2, sound.lines.tooth
    tooth, run_out = order == 0, (order == 1) | (order == teeth - 1)
    uneven = float(np.sum(power[~run_out & ~tooth]))
    is_odd = uneven > OTHER_TEETH * float(np.sum(power[run_out & ~tooth])) and uneven > QUIET * float(np.sum(power))
    is_loud = immersion < SLOT and float(np.sum(power[~tooth])) > RUN_OUT * float(np.sum(power[tooth]))
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
