"""Evaluate recorded cuts: stable, chatter, flip, or a reason for no verdict.

The thresholds of this folder were chosen on simulated cuts, with other random numbers than those of the long tests
(docs/studies/cuts.md, How often it is right).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from lobewatch.arrays import Flags, Floats
from lobewatch.cuts.chatter_detection import load_ripple, spindle_speed
from lobewatch.cuts.chatter_detection import peak_classification as classification
from lobewatch.cuts.chatter_detection import spectrum as spectral
from lobewatch.cuts.chatter_detection.cut_detection import CutParts, trim_overload
from lobewatch.cuts.chatter_detection.cut_windows import MIN_CHATTER_FREQUENCY, NOTHING_KNOWN, KnownCut
from lobewatch.cuts.chatter_detection.evaluated_cut import CutEvaluation, group_peaks, rank_evidence
from lobewatch.cuts.chatter_detection.load_ripple import Ripple
from lobewatch.cuts.chatter_detection.pass_detection import find_cuts_in_shop
from lobewatch.cuts.chatter_detection.peak_classification import ChatterPeaks, PeaksByOrigin
from lobewatch.cuts.chatter_detection.spectrum import Spectra, Spectrum
from lobewatch.cuts.chatter_detection.tooth_passing_comb import MAX_COMB_PEAKS, SpindleSpeed, refine_comb
from lobewatch.cuts.chatter_detection.window_evaluation import evaluate_windows

__all__ = ["CutEvaluation", "CutRecording", "evaluate_cut", "evaluate_recording", "group_peaks"]

MIN_CHATTER_ENERGY = 5e-4
"""Energy of unexplained peaks over that of the comb, above which a cut with sidebands chatters."""
MIN_SINGLE_PEAK_ENERGY = 1e-2
"""Energy of unexplained peaks over that of the comb, above which a cut without sidebands chatters."""
MAX_STABLE_ENERGY = 2e-4
"""Energy of unexplained peaks over that of the comb, below which a cut is stable."""
MIN_CHATTER_OVER_RIPPLE = 1.5
"""Energy of unexplained peaks over that of ripple, below which they are its transients, as after each rib; chosen."""
MAX_PULSE_EVENNESS = 0.58
"""Evenness of the power of unexplained peaks below which they are modes that ring after each rib; chosen.

Chatter that ripples by 40 % has more."""
MIN_STEADY_EVENNESS, MIN_UNEVEN_ENERGY = 0.9, 0.1
"""Evenness of steady chatter, and least energy over that of the comb of any other, or where the speed ripples; chosen.

Side bands of ripple, amplified by a mode, have up to a tenth."""
MIN_CHATTER_MODE_SHARE = 0.5
"""Lowest frequency of chatter over that of the lowest mode; chosen."""
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


def evaluate_cut(
    cut: Floats,
    air: Floats,
    sample_rate: float,
    teeth: int,
    immersion: float,
    commanded_rpm: float,
    measured_rpm: float | None = None,
    known: KnownCut = NOTHING_KNOWN,
) -> CutEvaluation:
    """Evaluate the steady part of a cut; cut and air in any unit, shape (n,) or (axes, n), sample_rate in Hz.

    air: the same spindle turning without a cut, n = 0 where there is none; immersion: radial depth over diameter;
    commanded_rpm as it was set; measured_rpm by a tachometer, which the peaks must not contradict
    ("tacho-contradicts"); None without one; known: from other windows of the cut. All axes have one speed, and the
    verdict is that of the loudest evidence: of the axis with the loudest chatter, else of that with the loudest cut.
    Reasons without a verdict: "speed-not-found", "no-air" (also where only peaks that are there in air make a speed,
    which is named), "on-spindle-lines" (period two of an even number of teeth, or chatter locked to the spindle),
    "faint", "unexplained-tone" (a peak without sidebands), "other-source" (most unexplained peaks are no chatter),
    "slow-sampling" (fewer than three harmonics of tooth passing are recorded, folded ones too), "teeth-contradicted"
    (the harmonics are those of another number of teeth).

    Example: tooth passing of four teeth at 6000 rpm, its harmonics and a little noise.

    >>> time, random = np.arange(10_000) / 10e3, np.random.default_rng(0)
    >>> comb = sum(np.sin(2 * np.pi * 400 * k * time) / k for k in range(1, 9))
    >>> air, cut = 0.01 * random.normal(size=(2, time.size)) + [[0.0], [1.0]] * comb
    >>> heard = evaluate_cut(cut, air, 10e3, 4, 0.5, 6020.0)
    >>> heard.verdict, round(heard.speed_rpm)
    ('stable', 6000)
    """
    spectra: Spectra = spectral.compute_spectra(cut, sample_rate)
    if not air.shape[-1]:
        return _evaluate_without_air(spectra, teeth, commanded_rpm / 60)._replace(reason="no-air")
    quiet: Spectra = known.air or spectral.compute_spectra(air, sample_rate)
    is_measured = measured_rpm is not None and bool(np.isfinite(measured_rpm))
    followed = known.speed and not is_measured and spindle_speed.follow_speed(spectra, quiet, known.speed)
    followed = followed or (known.speed if known.is_short else None)
    asked = teeth, commanded_rpm / 60, measured_rpm if is_measured else None
    speed = followed or _find_speed(spectra, quiet, *asked)
    if isinstance(speed, CutEvaluation):
        return speed
    even, spectra, quiet, speed, ripple = _even_speed(np.atleast_2d(cut), spectra, quiet, speed)
    gaps = [[gap[i] for gap in known.shop] or [axis] for i, axis in enumerate(np.atleast_2d(air))]
    axes = zip(even, gaps, spectra, quiet, strict=True)
    about = speed, teeth, immersion, known
    sounds = [_evaluate_axis(*axis, *about)._replace(axis=i) for i, axis in enumerate(axes)]
    sounds = [_compare_with_ripple(sound, even, ripple) for sound in _compare_axes(sounds)]
    sound = max(sounds, key=rank_evidence)._replace(ripple=ripple)
    tooth = speed.frequency * teeth
    if speed == known.speed and sound.chatter and classification.has_other_spacing(sound.chatter, tooth):
        return _speed_not_found(sound.spectrum or spectra[0], np.nan)
    others = None if sound.peaks is None else sound.peaks.unexplained
    if is_measured or known.speed or sound.verdict == "stable" or not others:
        return sound
    distant = 60 * spindle_speed.find_distant_speed(spectra, quiet, teeth, commanded_rpm / 60, speed, others)
    return sound if np.isnan(distant) else _speed_not_found(spectra[0], distant)


def _even_speed(
    cut: Floats, spectra: Spectra, quiet: Spectra, speed: SpindleSpeed
) -> tuple[Floats, Spectra, Spectra, SpindleSpeed, Ripple | None]:
    """Sample a cut at equal angles if its speed ripples, and return its ripple."""
    envelopes = load_ripple.follow_multiples(cut, spectra, speed.frequency)
    ahead = load_ripple.find_deviation(envelopes)
    ripple = load_ripple.find_ripple(envelopes, ahead)
    if not ahead.size:
        return cut, spectra, quiet, speed, ripple
    rate, times = spectra[0].sample_rate, np.arange(ahead.size) / envelopes.rate
    deviation = rate * np.interp(np.arange(cut.shape[1]) / rate, times, ahead)
    even = load_ripple.sample_evenly(cut, deviation)
    spectra = spectral.compute_spectra(even, rate)
    peaks = classification.find_cut_peaks(spectra, quiet).loudest(MAX_COMB_PEAKS)
    refined = refine_comb(speed.frequency, peaks, spectra[0].bin_width)
    return even, spectra, [load_ripple.widen_air(air) for air in quiet], refined or speed, ripple


def _compare_axes(sounds: Sequence[CutEvaluation]) -> list[CutEvaluation]:
    """Compare chatter with the loudest comb of all axes, as an axis with hardly any cut shows all that is faint."""
    combs = [0.0 if sound.peaks is None else sound.peaks.comb.energy for sound in sounds]
    loudest, compared = max(combs), list(sounds)
    for i, (sound, comb) in enumerate(zip(sounds, combs, strict=True)):
        if sound.chatter is not None and comb < loudest:
            ratio = sound.energy_ratio * max(comb, MIN_COMB_ENERGY * loudest) / loudest
            if ratio < _least_energy(sound.chatter):
                compared[i] = sound._replace(verdict="cannot tell", reason="faint", chatter=None, energy_ratio=ratio)
    return compared


def _compare_with_ripple(sound: CutEvaluation, even: Floats, ripple: Ripple | None) -> CutEvaluation:
    """Compare chatter with ripple in a stable cut: its side bands, and modes that ring after each rib."""
    if sound.chatter is None or sound.spindle_speed is None or sound.spectrum is None or sound.peaks is None:
        return sound
    about = sound.spectrum, sound.peaks.air.frequency, sound.spindle_speed.frequency
    evenness = load_ripple.compute_evenness(even[sound.axis], *about)
    is_even = evenness > MIN_STEADY_EVENNESS and not (ripple and ripple.speed)
    if evenness > MAX_PULSE_EVENNESS and (is_even or sound.energy_ratio > MIN_UNEVEN_ENERGY):
        return sound
    return sound._replace(verdict="cannot tell", reason="faint", chatter=None)


def _least_energy(chatter: ChatterPeaks) -> float:
    """Return the smallest energy of unexplained peaks over that of the comb that is chatter."""
    return MIN_CHATTER_ENERGY if len(chatter.peaks) >= classification.MIN_SIDEBANDS else MIN_SINGLE_PEAK_ENERGY


def _evaluate_axis(
    cut: Floats,
    air: Sequence[Floats],
    spectrum: Spectrum,
    quiet: Spectrum,
    speed: SpindleSpeed,
    teeth: int,
    immersion: float,
    known: KnownCut,
) -> CutEvaluation:
    """Evaluate one axis; a tone without sidebands is searched in pieces of the air, too."""
    peaks = spectral.find_separate_peaks(spectrum)
    unsteady = classification.estimate_unsteadiness(cut, spectrum.sample_rate, peaks, speed, spectrum.bin_width)

    def evaluate(quiet: Spectrum) -> CutEvaluation:
        by_origin = classification.classify_peaks(peaks, spectrum, quiet, speed, teeth, unsteady)
        return _evaluate_peaks(by_origin, spectrum, speed, cut, teeth, immersion, known)

    sound = evaluate(quiet)
    is_searched = sound.verdict != "stable" if known.shop else sound.reason == "unexplained-tone"
    if is_searched and sound.peaks is not None:
        for gap in air:
            quiet = classification.add_air_tones(quiet, gap, sound.peaks.unexplained.frequency)
        sound = evaluate(quiet)
    if not known.shop or sound.reason != "faint" or sound.peaks is None:
        return sound
    left, tooth = sound.peaks.unexplained, speed.frequency * teeth
    chatter = classification.find_chatter_peaks(left, tooth, spectrum.bin_width)
    if classification.has_sidebands(left, chatter, speed.frequency, spectrum.bin_width):
        return sound
    return _evaluate_stable(sound._replace(verdict="stable", reason=""), sound.peaks, teeth, immersion)


def _find_speed(
    spectra: Spectra, quiet: Spectra, teeth: int, commanded: float, measured_rpm: float | None
) -> SpindleSpeed | CutEvaluation:
    """Find the spindle speed, or return the evaluation of a cut without one; commanded in Hz."""
    if measured_rpm is None:
        speed = spindle_speed.find_speed_of_spectra(spectra, quiet, teeth, commanded)
        if speed is not None:
            return speed
        distant = 60 * spindle_speed.find_distant_speed(spectra, quiet, teeth, commanded, None, None)
        if np.isfinite(distant):
            return _speed_not_found(spectra[0], distant)
        return _evaluate_without_air(spectra, teeth, commanded)
    speed, other = spindle_speed.check_tachometer_speed(spectra, quiet, teeth, commanded, measured_rpm / 60)
    if np.isfinite(other):
        return CutEvaluation("cannot tell", "tacho-contradicts", spectrum=spectra[0], distant_rpm=60 * other)
    return speed or _speed_not_found(spectra[0], np.nan)


def _evaluate_without_air(spectra: Spectra, teeth: int, commanded: float) -> CutEvaluation:
    """Evaluate the speed only, if there is no air or its spectrum is that of the cut."""
    air = [spectrum._replace(power=np.zeros(spectrum.power.size)) for spectrum in spectra]
    speed = spindle_speed.find_speed_of_spectra(spectra, air, teeth, commanded)
    if speed is None:
        return _speed_not_found(spectra[0], np.nan)
    peaks = classification.find_cut_peaks(spectra, air)
    reach = spectral.PEAK_TOLERANCE * spectra[0].bin_width
    others = peaks[spectral.fold_frequency(peaks.frequency, speed.frequency) > reach]
    distant = spindle_speed.find_distant_speed(spectra, air, teeth, commanded, speed, others) if len(others) else np.nan
    if np.isfinite(distant):
        return _speed_not_found(spectra[0], 60 * distant)
    return CutEvaluation("cannot tell", "no-air", spindle_speed=speed, spectrum=spectra[0])


def _speed_not_found(spectrum: Spectrum, distant: float) -> CutEvaluation:
    """Return the evaluation of a cut whose speed is not near the commanded one; elsewhere: a speed that fits (rpm)."""
    return CutEvaluation("cannot tell", "speed-not-found", spectrum=spectrum, distant_rpm=distant)


def _evaluate_peaks(
    peaks: PeaksByOrigin,
    spectrum: Spectrum,
    speed: SpindleSpeed,
    signal: Floats,
    teeth: int,
    immersion: float,
    known: KnownCut,
) -> CutEvaluation:
    """Evaluate an axis with classified peaks."""
    peaks = _remove_ripple(peaks, spectrum, speed, known.lowest)
    sound = CutEvaluation("stable", "", spindle_speed=speed, energy_ratio=0.0, peaks=peaks, spectrum=spectrum)
    n_harmonics = np.count_nonzero(peaks.tooth_order == 0) + len(peaks.folded)
    if classification.is_undersampled(spectrum, speed, teeth) and n_harmonics < classification.MIN_TOOTH_HARMONICS:
        return sound._replace(verdict="cannot tell", reason="slow-sampling")
    other = classification.find_other_teeth(peaks.comb, speed, teeth)
    found = _evaluate_unexplained(sound, peaks, spectrum, speed, signal, other or teeth, immersion, known)
    if not other or found.reason == "other-source":
        return found
    return sound._replace(verdict="cannot tell", reason="teeth-contradicted", comb_teeth=other)


def _evaluate_unexplained(
    sound: CutEvaluation,
    peaks: PeaksByOrigin,
    spectrum: Spectrum,
    speed: SpindleSpeed,
    signal: Floats,
    teeth: int,
    immersion: float,
    known: KnownCut,
) -> CutEvaluation:
    """Evaluate the unexplained peaks of an axis; sound: as if it was stable."""
    if not len(peaks.unexplained):
        return _evaluate_stable(sound, peaks, teeth, immersion)
    tooth = speed.frequency * teeth
    chatter = classification.find_chatter_peaks(peaks.unexplained, tooth, spectrum.bin_width)
    still = 1.0 if known.is_begun else _share_at_end(chatter, signal, spectrum.sample_rate)
    ratio = still * peaks.unexplained.energy / max(peaks.comb.energy, MIN_COMB_ENERGY * peaks.unexplained.energy)
    sound = sound._replace(energy_ratio=ratio)
    if ratio < MAX_STABLE_ENERGY:
        return _evaluate_stable(sound, peaks, teeth, immersion)
    if ratio < _least_energy(chatter):
        return sound._replace(verdict="cannot tell", reason="faint")
    if not classification.has_sidebands(peaks.unexplained, chatter, speed.frequency, spectrum.bin_width):
        return sound._replace(verdict="cannot tell", reason="unexplained-tone", tone=chatter.frequency)
    is_faint = ratio < MIN_SINGLE_PEAK_ENERGY
    if classification.is_other_source(peaks.unexplained, chatter, speed.frequency, spectrum.bin_width, is_faint):
        return sound._replace(verdict="cannot tell", reason="other-source")
    half = abs(chatter.frequency / tooth % 1 - 0.5) < FLIP_TOLERANCE
    return sound._replace(verdict="flip" if half else "chatter", chatter=chatter)


def _share_at_end(chatter: ChatterPeaks, signal: Floats, sample_rate: float) -> float:
    """Return the power of chatter in the second half of a window over that in all of it, at most 1."""
    end = spectral.compute_spectrum(signal[signal.size // 2 :], sample_rate)
    power = float(end.max_power_near(np.array([chatter.frequency]), END_PEAK_TOLERANCE)[0])
    at = int(np.argmin(np.abs(chatter.peaks.frequency - chatter.frequency)))
    return min(power / float(chatter.peaks.amplitude[at] ** 2), 1.0)


def _remove_ripple(peaks: PeaksByOrigin, spectrum: Spectrum, speed: SpindleSpeed, lowest: float) -> PeaksByOrigin:
    """Remove side bands of ripple, and what is below the lowest frequency of chatter (Hz), from unexplained peaks."""
    left = peaks.unexplained[peaks.unexplained.frequency >= lowest]
    if len(left) and len(peaks.comb):
        is_ripple = load_ripple.find_ripple_peaks(left, peaks.comb, spectrum, speed.frequency)
        is_ripple |= left[~is_ripple].energy < MIN_CHATTER_OVER_RIPPLE * left[is_ripple].energy
        left = left[~is_ripple]
    return peaks._replace(unexplained=left)


def _evaluate_stable(sound: CutEvaluation, peaks: PeaksByOrigin, teeth: int, immersion: float) -> CutEvaluation:
    """Evaluate as stable, unless few harmonics are heard, or louder ones than runout and uneven teeth make them."""
    if (
        sound.spectrum
        and sound.spindle_speed
        and classification.is_narrow(peaks, sound.spectrum, sound.spindle_speed, teeth)
    ):
        return sound._replace(verdict="cannot tell", reason="slow-sampling")
    power, order = peaks.comb.amplitude**2, peaks.tooth_order
    tooth, run_out = order == 0, (order == 1) | (order == teeth - 1)
    uneven = float(np.sum(power[~run_out & ~tooth]))
    is_odd = uneven > max(MAX_UNEVEN_ENERGY * np.sum(power[run_out & ~tooth]), MAX_STABLE_ENERGY * np.sum(power))
    is_loud = immersion < SLOT_IMMERSION and np.sum(power[~tooth]) > MAX_RUNOUT_ENERGY * np.sum(power[tooth])
    return sound._replace(verdict="cannot tell", reason="on-spindle-lines") if is_odd or is_loud else sound


class CutRecording(NamedTuple):
    """Recording to be evaluated."""

    signal: Floats
    """Acceleration of the housing (m/s^2), shape (n,), or (axes, n) for several axes on one spindle."""
    sample_rate: float
    """Sample rate (Hz)."""
    teeth: int
    """Number of teeth of the cutter."""
    immersion: float
    """Radial depth of cut over diameter (-)."""
    commanded_rpm: float
    """Commanded spindle speed (rpm)."""
    clipped: Flags | None = None
    """Overloaded samples of sensor or input, shape (n,); None without overload."""
    lost_scans: int = 0
    """Number of lost scans."""
    measured_rpm: Floats | None = None
    """Tachometer speed at each sample (rpm), NaN without pulses, shape (n,); None without a tachometer."""
    lowest_mode: float = 0.0
    """Frequency of the lowest known mode of the tool (Hz); 0 without one."""


def evaluate_recording(recording: CutRecording) -> list[CutEvaluation]:
    """Evaluate each cut in a recording; without a cut the only entry gives the reason.

    Reasons without a verdict are those of `find_cuts_in_shop` and `evaluate_cut`, "overload" and "lost-scans".
    """
    commanded = recording.commanded_rpm / 60
    cuts = find_cuts_in_shop(recording.signal, recording.sample_rate, recording.teeth, commanded)
    return [_evaluate_windows(recording, parts) for parts in cuts]


def _evaluate_windows(recording: CutRecording, parts: CutParts) -> CutEvaluation:
    """Evaluate all windows of a cut."""
    rate, axes = recording.sample_rate, np.atleast_2d(np.asarray(recording.signal, dtype=np.float64))
    lowest = max(MIN_CHATTER_FREQUENCY, MIN_CHATTER_MODE_SHARE * recording.lowest_mode)
    if parts.reason in ("too-short", "no-cut", "no-air") or recording.lost_scans:
        return _evaluate_window(recording, parts, KnownCut(lowest=lowest))

    def evaluate(place: slice, known: KnownCut) -> CutEvaluation:
        of_window = parts if place == parts.cut else parts._replace(cut=place, reason="")
        return _evaluate_window(recording, of_window, known)

    shop = tuple(axes[:, gap] for gap in parts.shop)
    known = KnownCut(None, spectral.compute_spectra(axes[:, parts.air], rate), lowest, shop=shop)
    return evaluate_windows(evaluate, axes, parts, rate, known)


def _evaluate_window(recording: CutRecording, parts: CutParts, known: KnownCut) -> CutEvaluation:
    """Evaluate the samples `cut` of parts, without those near an overload."""
    if recording.clipped is not None:
        parts = trim_overload(parts, recording.clipped, recording.sample_rate)
    reason = _find_signal_fault(recording, parts)
    if reason and reason != "no-air":
        return CutEvaluation("cannot tell", reason, parts)
    measured = None if recording.measured_rpm is None else _mean_speed(recording.measured_rpm[parts.cut])
    axes = np.atleast_2d(np.asarray(recording.signal, dtype=np.float64))
    air = axes[:, slice(0, 0) if reason else parts.air]
    _, sample_rate, teeth, immersion, commanded_rpm, *_ = recording
    sound = evaluate_cut(axes[:, parts.cut], air, sample_rate, teeth, immersion, commanded_rpm, measured, known)
    return sound._replace(parts=parts, measured_rpm=measured)


def _mean_speed(speed: Floats) -> float:
    """Return the mean speed where it is known; NaN where that is less than half of the time."""
    known = speed[np.isfinite(speed)]
    return float(np.mean(known)) if 2 * known.size > speed.size else np.nan


def _find_signal_fault(recording: CutRecording, parts: CutParts) -> str:
    """Return the code of why the signal cannot be trusted; empty if it can."""
    if parts.reason == "too-short":
        return parts.reason
    if recording.clipped is not None and np.any(recording.clipped if parts.reason else recording.clipped[parts.cut]):
        return "overload"
    return "lost-scans" if recording.lost_scans else parts.reason
