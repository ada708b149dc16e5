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
from lobewatch.cuts.chatter_detection.axis_evaluation import MIN_COMB_ENERGY, CutAxis, evaluate_axis, least_energy
from lobewatch.cuts.chatter_detection.cut_detection import CutParts, trim_overload
from lobewatch.cuts.chatter_detection.cut_windows import MIN_CHATTER_FREQUENCY, NOTHING_KNOWN, KnownCut
from lobewatch.cuts.chatter_detection.evaluated_cut import CutEvaluation, group_peaks, is_beyond_ripple, rank_evidence
from lobewatch.cuts.chatter_detection.load_ripple import Ripple
from lobewatch.cuts.chatter_detection.pass_detection import find_cuts_in_shop
from lobewatch.cuts.chatter_detection.spectrum import Spectra, Spectrum
from lobewatch.cuts.chatter_detection.tooth_passing_comb import MAX_COMB_PEAKS, SpindleSpeed, refine_comb
from lobewatch.cuts.chatter_detection.window_evaluation import evaluate_windows

__all__ = ["CutEvaluation", "CutRecording", "evaluate_cut", "evaluate_recording", "group_peaks"]

MAX_PULSE_EVENNESS = 0.58
"""Evenness of the power of unexplained peaks below which they are modes that ring after each rib; chosen.

Chatter that ripples by 40 % has more."""
MIN_STEADY_EVENNESS, MIN_UNEVEN_ENERGY = 0.9, 0.1
"""Evenness of steady chatter, and least energy over that of the comb of any other, or where the speed ripples; chosen.

Side bands of ripple, amplified by a mode, have up to a tenth."""
MIN_CHATTER_MODE_SHARE = 0.5
"""Lowest frequency of chatter over that of the lowest mode; chosen."""


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
    if known.shop and abs(60 * speed.frequency / commanded_rpm - 1) > spindle_speed.VOTE_SPEED_TOLERANCE:
        return _speed_not_found(spectra[0], 60 * speed.frequency)  # notes of music fit combs up to 5 % away
    even, spectra, quiet, speed, ripple = _even_speed(np.atleast_2d(cut), spectra, quiet, speed)
    gaps = [[gap[i] for gap in known.shop] or [axis] for i, axis in enumerate(np.atleast_2d(air))]
    about = speed, teeth, immersion, known, ripple
    axes = [CutAxis(one, spectrum, *about) for one, spectrum in zip(even, spectra, strict=True)]
    sounds = [evaluate_axis(*each)._replace(axis=i) for i, each in enumerate(zip(axes, gaps, quiet, strict=True))]
    sounds = [_compare_with_ripple(sound, axes[sound.axis]) for sound in _compare_axes(sounds)]
    sound = max(sounds, key=rank_evidence)
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
        if sound.chatter is not None and sound.spindle_speed is not None and comb < loudest:
            ratio = sound.energy_ratio * max(comb, MIN_COMB_ENERGY * loudest) / loudest
            if ratio < least_energy(sound.chatter, sound.spindle_speed):
                compared[i] = sound._replace(verdict="cannot tell", reason="faint", chatter=None, energy_ratio=ratio)
    return compared


def _compare_with_ripple(sound: CutEvaluation, axis: CutAxis) -> CutEvaluation:
    """Compare chatter with ripple in a stable cut: its side bands, and modes that ring after each rib."""
    if sound.chatter is None or sound.peaks is None or is_beyond_ripple(sound):
        return sound
    about = axis.spectrum, sound.peaks.air.frequency, axis.turn, axis.known.lowest
    evenness = load_ripple.compute_evenness(axis.signal, *about)
    is_even = evenness > MIN_STEADY_EVENNESS and not (axis.ripple and axis.ripple.speed)
    if evenness > MAX_PULSE_EVENNESS and (is_even or sound.energy_ratio > MIN_UNEVEN_ENERGY):
        return sound
    return sound._replace(verdict="cannot tell", reason="faint", chatter=None)


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
