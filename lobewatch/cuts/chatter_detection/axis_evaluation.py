"""Evaluate one axis of a cut: which of its peaks are chatter, ripple, or of another source."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lobewatch.arrays import Floats
from lobewatch.cuts.chatter_detection import load_ripple
from lobewatch.cuts.chatter_detection import peak_classification as classification
from lobewatch.cuts.chatter_detection import spectrum as spectral
from lobewatch.cuts.chatter_detection.cut_windows import KnownCut
from lobewatch.cuts.chatter_detection.evaluated_cut import CutEvaluation
from lobewatch.cuts.chatter_detection.load_ripple import Ripple
from lobewatch.cuts.chatter_detection.peak_classification import ChatterPeaks, PeaksByOrigin
from lobewatch.cuts.chatter_detection.spectrum import SpectralPeaks, Spectrum
from lobewatch.cuts.chatter_detection.tooth_passing_comb import SpindleSpeed

MIN_CHATTER_ENERGY = 5e-4
"""Energy of unexplained peaks over that of the comb, above which a cut with sidebands chatters."""
MIN_SINGLE_PEAK_ENERGY = 1e-2
"""Energy of unexplained peaks over that of the comb, above which a cut without sidebands chatters."""
MIN_SURE_SHARE = 0.75
"""Smallest share of the peaks explained by a speed, below which chatter must be as loud as without sidebands."""
MAX_CHATTER_FREQUENCY = 10e3
"""Highest frequency of chatter (Hz): codecs fill the band above with copies of lower lines; chosen."""
MAX_STABLE_ENERGY = 2e-4
"""Energy of unexplained peaks over that of the comb, below which a cut is stable."""
MIN_CHATTER_OVER_RIPPLE = 1.5
"""Energy of unexplained peaks over that of ripple, below which they are its transients, as after each rib; chosen."""
MIN_BEYOND_RIPPLE = 0.5
"""Energy of peaks where ripple has few over that of ripple, from which there is chatter; chosen.

Sharp edges reach them with up to a seventh."""
MIN_COMB_ENERGY = 1e-9
"""Smallest energy assumed for the comb, over that of unexplained peaks."""
FLIP_TOLERANCE = 0.003
"""Distance from half the tooth passing frequency, relative to that, within which chatter is of period two (flip)."""
MAX_UNEVEN_ENERGY = 5.0
"""Energy of orders without run-out (modulo the teeth neither 0 nor +-1) over that of orders with run-out, at most."""
MAX_RUNOUT_ENERGY = 8.0
"""Largest energy of all other orders over that of tooth passing, in a cut narrower than a slot."""
SLOT_IMMERSION = 0.95
"""Immersion above which tooth passing nearly vanishes (-)."""
END_PEAK_TOLERANCE = 1.0
"""Distance up to which a peak at the end of a cut matches one of the whole cut (bins)."""


class CutAxis(NamedTuple):
    """One axis of a cut whose speed is known."""

    signal: Floats
    """Samples of the cut, shape (n,)."""
    spectrum: Spectrum
    """Spectrum of them."""
    speed: SpindleSpeed
    """Spindle speed of all axes."""
    teeth: int
    """Number of teeth of the cutter."""
    immersion: float
    """Radial depth of cut over diameter (-)."""
    known: KnownCut
    """Facts from other windows of the cut."""
    ripple: Ripple | None
    """Ripple of all axes; None if the cut is steady."""

    @property
    def turn(self) -> float:
        """Spindle frequency (Hz)."""
        return self.speed.frequency

    @property
    def tooth(self) -> float:
        """Tooth passing frequency (Hz)."""
        return self.turn * self.teeth


def evaluate_axis(axis: CutAxis, air: Sequence[Floats], quiet: Spectrum) -> CutEvaluation:
    """Evaluate one axis; a tone without sidebands is searched in pieces of the air, too.

    air: signals of the axis without a cut; quiet: its spectrum.
    """
    spectrum, speed, shop = axis.spectrum, axis.speed, axis.known.shop
    peaks = spectral.find_separate_peaks(spectrum)
    unsteady = classification.estimate_unsteadiness(axis.signal, spectrum.sample_rate, peaks, speed, spectrum.bin_width)

    def evaluate(quiet: Spectrum) -> CutEvaluation:
        return _evaluate_peaks(axis, classification.classify_peaks(peaks, spectrum, quiet, speed, axis.teeth, unsteady))

    sound = evaluate(quiet)
    is_searched = sound.verdict != "stable" if shop else sound.reason == "unexplained-tone"
    if is_searched and sound.peaks is not None:
        for gap in air:
            quiet = classification.add_air_tones(quiet, gap, sound.peaks.unexplained.frequency)
        sound = evaluate(quiet)
    if not shop or sound.reason != "faint" or sound.peaks is None:
        return sound
    left = sound.peaks.unexplained
    chatter = classification.find_chatter_peaks(left, axis.tooth, spectrum.bin_width)
    if classification.has_sidebands(left, chatter, axis.turn, spectrum.bin_width):
        return sound
    return _evaluate_stable(axis, sound._replace(verdict="stable", reason=""), sound.peaks)


def _evaluate_peaks(axis: CutAxis, peaks: PeaksByOrigin) -> CutEvaluation:
    """Evaluate an axis with classified peaks."""
    spectrum, speed, teeth = axis.spectrum, axis.speed, axis.teeth
    peaks = _remove_ripple(axis, peaks)
    found = CutEvaluation("stable", "", spindle_speed=speed, energy_ratio=0.0, peaks=peaks)
    sound = found._replace(spectrum=spectrum, ripple=axis.ripple)
    n_harmonics = np.count_nonzero(peaks.tooth_order == 0) + len(peaks.folded)
    if classification.is_undersampled(spectrum, speed, teeth) and n_harmonics < classification.MIN_TOOTH_HARMONICS:
        return sound._replace(verdict="cannot tell", reason="slow-sampling")
    other = classification.find_other_teeth(peaks.comb, speed, teeth)
    found = _evaluate_unexplained(axis._replace(teeth=other or teeth), sound, peaks)
    if not other or found.reason == "other-source":
        return found
    return sound._replace(verdict="cannot tell", reason="teeth-contradicted", comb_teeth=other)


def _evaluate_unexplained(axis: CutAxis, sound: CutEvaluation, peaks: PeaksByOrigin) -> CutEvaluation:
    """Evaluate the unexplained peaks of an axis; sound: as if it was stable."""
    left, bin_width = peaks.unexplained, axis.spectrum.bin_width
    if not len(left):
        return _evaluate_stable(axis, sound, peaks)
    chatter = classification.find_chatter_peaks(left, axis.tooth, bin_width)
    still = 1.0 if axis.known.is_begun else _share_at_end(chatter, axis.signal, axis.spectrum.sample_rate)
    ratio = still * left.energy / max(peaks.comb.energy, MIN_COMB_ENERGY * left.energy)
    sound = sound._replace(energy_ratio=ratio)
    if ratio < MAX_STABLE_ENERGY:
        return _evaluate_stable(axis, sound, peaks)
    if ratio < least_energy(chatter, axis.speed):
        return sound._replace(verdict="cannot tell", reason="faint")
    chatter, reason = _choose_family(axis, left, chatter, ratio < MIN_SINGLE_PEAK_ENERGY)
    if reason:
        tone = chatter.frequency if reason == "unexplained-tone" else np.nan
        return sound._replace(verdict="cannot tell", reason=reason, tone=tone)
    half = abs(chatter.frequency / axis.tooth % 1 - 0.5) < FLIP_TOLERANCE
    return sound._replace(verdict="flip" if half else "chatter", chatter=chatter)


def _choose_family(axis: CutAxis, left: SpectralPeaks, named: ChatterPeaks, is_faint: bool) -> tuple[ChatterPeaks, str]:
    """Choose the named family of peaks, or else the loudest, with the reason why it is no chatter; empty if it is.

    The loudest family needs three loud peaks, or nearly all energy, as where a cut chatters at two frequencies.
    """
    turn, bin_width = axis.turn, axis.spectrum.bin_width
    reasons = []
    loudest = classification.find_loudest_family(left, axis.tooth, bin_width)
    is_clear = len(loudest.peaks) >= classification.MIN_SIDEBANDS
    is_clear |= loudest.peaks.energy > classification.MIN_WEAK_CHATTER_SHARE * left.energy
    for family in (named, loudest) if is_clear else (named,):
        if not classification.has_sidebands(left, family, turn, bin_width):
            reasons.append("unexplained-tone")
        elif classification.is_other_source(left, family, turn, axis.teeth, bin_width, is_faint):
            reasons.append("other-source")
        else:
            return family, ""
    return named, reasons[0]


def least_energy(chatter: ChatterPeaks, speed: SpindleSpeed) -> float:
    """Return the smallest energy of unexplained peaks over that of the comb that is chatter at a speed."""
    is_proven = len(chatter.peaks) >= classification.MIN_SIDEBANDS and speed.share >= MIN_SURE_SHARE
    return MIN_CHATTER_ENERGY if is_proven else MIN_SINGLE_PEAK_ENERGY


def _share_at_end(chatter: ChatterPeaks, signal: Floats, sample_rate: float) -> float:
    """Return the power of chatter in the second half of a window over that in all of it, at most 1."""
    end = spectral.compute_spectrum(signal[signal.size // 2 :], sample_rate)
    power = float(end.max_power_near(np.array([chatter.frequency]), END_PEAK_TOLERANCE)[0])
    at = int(np.argmin(np.abs(chatter.peaks.frequency - chatter.frequency)))
    return min(power / float(chatter.peaks.amplitude[at] ** 2), 1.0)


def _remove_ripple(axis: CutAxis, peaks: PeaksByOrigin) -> PeaksByOrigin:
    """Remove side bands of ripple, and what is below or above all chatter, from unexplained peaks."""
    left = load_ripple.remove_slow_comb(peaks.unexplained, axis.spectrum.bin_width, axis.turn)
    left = left[(left.frequency >= axis.known.lowest) & (left.frequency <= MAX_CHATTER_FREQUENCY)]
    if len(left) and len(peaks.comb):
        is_ripple = load_ripple.find_ripple_peaks(left, peaks.comb, axis.spectrum, axis.turn, axis.ripple)
        ripple, rest = left[is_ripple].energy, left[~is_ripple]
        beyond = axis.ripple.energy_beyond(rest, axis.turn, axis.spectrum.bin_width) if axis.ripple else 0.0
        is_more = rest.energy > MIN_CHATTER_OVER_RIPPLE * ripple or beyond > MIN_BEYOND_RIPPLE * ripple
        left = rest[np.full(len(rest), is_more)]
    return peaks._replace(unexplained=left)


def _evaluate_stable(axis: CutAxis, sound: CutEvaluation, peaks: PeaksByOrigin) -> CutEvaluation:
    """Evaluate as stable, unless few harmonics are heard, or louder ones than runout and uneven teeth make them."""
    if classification.is_narrow(peaks, axis.spectrum, axis.speed, axis.teeth):
        return sound._replace(verdict="cannot tell", reason="slow-sampling")
    power, order = peaks.comb.amplitude**2, peaks.tooth_order
    tooth, run_out = order == 0, (order == 1) | (order == axis.teeth - 1)
    uneven = float(np.sum(power[~run_out & ~tooth]))
    is_odd = uneven > max(MAX_UNEVEN_ENERGY * np.sum(power[run_out & ~tooth]), MAX_STABLE_ENERGY * np.sum(power))
    is_loud = axis.immersion < SLOT_IMMERSION and np.sum(power[~tooth]) > MAX_RUNOUT_ENERGY * np.sum(power[tooth])
    return sound._replace(verdict="cannot tell", reason="on-spindle-lines") if is_odd or is_loud else sound
