"""Evaluate one hit in time and frequency, and average the good hits."""

from __future__ import annotations

import functools
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.arrays import Floats
from acquisition.errors import DataError, join_sentences
from acquisition.estimation.estimate_frf import estimate_frf
from acquisition.frf import Frf
from acquisition.hit import Hit
from acquisition.hit_fault import HIT_FAULTS, TOUCH_TEXT, HitFlags
from acquisition.hit_quality.double_hit import find_force_hole, find_highest_touch, find_second_input
from acquisition.hit_quality.missing_response import is_saturated, is_steady, measure_levels
from acquisition.hit_quality.overload_and_hum import find_overload, fit_mains_hum, is_like_hum
from acquisition.hit_quality.swapped_channels import is_swapped, measure_swings
from acquisition.hits.force_window import window_force
from acquisition.hits.free_decay import MAX_CONTACT_TIME, extract_free_decay, measure_rest_noise
from acquisition.hits.pulse import Pulse, count_pre_hit_samples, find_pulse
from acquisition.hits.touches import Touch

Findings = dict[HitFlags, str]
"""Finding with its figures for each fault of a hit, without the remedy."""
MIN_LINE_SCATTER = 0.05
"""Lowest relative scatter assumed for a line, which bounds its weight."""
MIN_LONG_PULSE = 2e-3
"""Length of a force pulse from which a missing response is laid to a soft tip (s); chosen, steel has 0.2 to 1 ms."""
MIN_QUIET_SAMPLES = 8
"""Smallest number of samples before the hit that give the noise of the response; chosen."""


@dataclass(frozen=True)
class HitVerdict:
    """Faults of a hit and their remedies."""

    flags: HitFlags
    """Flags of the faults; falsy if the hit may be averaged."""
    reasons: tuple[str, ...] = ()
    """Finding with its figures, and remedy, of each flag in their order."""
    notes: tuple[str, ...] = ()
    """Findings that are no fault: a further touch that the FRF includes."""

    @classmethod
    def from_findings(cls, findings: Mapping[HitFlags, str], notes: tuple[str, ...] = ()) -> HitVerdict:
        """Return the verdict with these findings.

        Parameters
        ----------
        findings
            Finding for each flag, without the remedy.
        notes
            Findings that are no fault.
        """
        flags = functools.reduce(operator.or_, findings, HitFlags.OK)
        return cls(flags, tuple(join_sentences(findings[flag], flag.cure) for flag in flags), notes)

    @property
    def text(self) -> str:
        """All reasons in one text; empty for a good hit."""
        return " ".join(self.reasons)


def evaluate_hit(hit: Hit, mean: Frf | None = None, band: tuple[float, float] | None = None) -> HitVerdict:
    """Evaluate one hit, with the reasons against averaging it.

    Without `mean` and `band` only the time signals decide. A hit without a measured force is evaluated by its response.

    Parameters
    ----------
    hit
        Hit to evaluate.
    mean
        Mean of 3 or more good hits. A hit without other faults is compared with it (INCONSISTENT).
    band
        Frequency band to cover (Hz). The force must reach to its end (NARROW_BAND: 20 dB below its largest value).

    Returns
    -------
    HitVerdict
        Flags and reasons. With `mean` or `band` the force must reach over two lines (TOO_SOFT).

    References
    ----------
    ISO 7626-5 practice; docs/hit-verdicts.md.

    Examples
    --------
    >>> time = np.arange(-100, 4000) / 10240.0
    >>> pulse = np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)
    >>> structure = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    >>> hit = Hit(200 * pulse, 200 * structure.response(time, 1e-3), 10240.0, 100)
    >>> evaluate_hit(hit).flags == HitFlags.OK
    True
    >>> print(evaluate_hit(hit, band=(200.0, 4000.0)).text)
    The force spectrum reaches 2220 Hz (-20 dB) of the required 4000 Hz. Use a harder hammer tip.
    """
    findings = _evaluate_overloads(hit)
    if hit.lost_scans:
        findings |= _state(HitFlags.LOST_SCANS, count=hit.lost_scans)
    if not hit.has_force:
        return HitVerdict.from_findings(findings | ({} if findings else _evaluate_response(hit)) | _evaluate_decay(hit))
    if is_swapped(hit):
        return HitVerdict.from_findings(findings | _state(HitFlags.SWAPPED_CHANNELS))
    if is_saturated(hit):
        return HitVerdict.from_findings(_state(HitFlags.NO_RESPONSE, "saturated"))
    pulse = find_pulse(hit)
    if pulse is None:
        return HitVerdict.from_findings(findings | _state(HitFlags.NO_HIT))
    findings |= _evaluate_strength(hit, pulse, clipped=HitFlags.OVERLOAD_FORCE in findings)
    missing = _evaluate_response_level(hit, pulse)
    findings |= missing | ({} if HitFlags.NARROW_BAND in missing else _evaluate_times(hit, missing, band))
    if HitFlags.DOUBLE_HIT in findings:
        band = None  # the hole, not the tip, ends the band
    if band is not None or (mean is not None and not findings):
        findings |= evaluate_spectrum(hit, mean if not findings else None, band)
    return HitVerdict.from_findings(findings, () if HitFlags.DOUBLE_HIT in findings else describe_highest_touch(hit))


def check_hit(hit: Hit) -> HitFlags:
    """Return the faults of a hit, from its time signals only.

    Parameters
    ----------
    hit
        Hit to evaluate.

    Returns
    -------
    HitFlags
        Flags as `evaluate_hit` gives them; falsy where the hit may be averaged.

    Examples
    --------
    >>> time = np.arange(-100, 4000) / 10240.0
    >>> pulse = np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)
    >>> structure = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    >>> response = 200 * structure.response(time, 1e-3)
    >>> again = 190 * np.roll(pulse, 60)  # N, 6 ms later
    >>> [check_hit(Hit(force, response, 10240.0, 100)).words for force in (200 * pulse, 200 * pulse + again)]
    ['good', 'double hit']
    """
    return evaluate_hit(hit).flags


def average_good_hits(hits: Sequence[Hit]) -> tuple[Frf | None, tuple[HitFlags, ...]]:
    """Average the good hits of a recording.

    Parameters
    ----------
    hits
        Hits of one set-up.

    Returns
    -------
    frf : Frf or None
        H1 FRF of the good hits; None if no force was measured.
    flags : tuple of HitFlags
        Faults of each hit.

    Raises
    ------
    DataError
        If no hit is good; its text has the reasons.

    Examples
    --------
    >>> time = np.arange(-100, 4000) / 10240.0
    >>> pulse = np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)
    >>> structure = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    >>> response = 200 * structure.response(time, 1e-3)
    >>> forces = 200 * pulse, 200 * pulse + 190 * np.roll(pulse, 60), 201 * pulse
    >>> frf, flags = average_good_hits([Hit(force, response, 10240.0, 100) for force in forces])
    >>> frf.n_averages, [flag.words for flag in flags]
    (2, ['good', 'double hit', 'good'])
    """
    verdicts = [evaluate_hit(hit) for hit in hits]
    good = [hit for hit, verdict in zip(hits, verdicts, strict=True) if not verdict.flags]
    if not good:
        reasons = (f"Hit {i} ({verdict.flags.words}): {verdict.text}" for i, verdict in enumerate(verdicts, 1))
        raise DataError(join_sentences(f"no good hit among {len(hits)}", *reasons))
    return estimate_frf(good) if good[0].has_force else None, tuple(verdict.flags for verdict in verdicts)


def evaluate_spectrum(hit: Hit, mean: Frf | None, band: tuple[float, float] | None = None) -> Findings:
    """Evaluate a hit in the frequency domain: TOO_SOFT, NARROW_BAND and INCONSISTENT.

    mean: of other good hits; None or fewer than 3 hits are not compared. band: must be covered by the force (Hz).
    """
    frf = estimate_frf([hit])
    start, reach = frf.usable_band or (0.0, np.inf)
    if reach <= start:
        return _state(HitFlags.TOO_SOFT, "spectrum", start=start)
    findings: Findings = {}
    if band is not None and reach < band[1]:
        findings |= _state(HitFlags.NARROW_BAND, reach=reach, end=band[1])
    if mean is not None and mean.random_error is not None:
        limits = HIT_FAULTS[HitFlags.INCONSISTENT].limits
        distance, noise = compute_distance_from_mean(frf, mean)
        limit = max(limits["mean_distance"], limits["noise_ratio"] * noise)
        if distance > limit:
            figures = {"distance": distance, "count": mean.n_averages, "limit": limit}
            share = compare_magnitude(frf, mean)
            case = "weaker" if share < 1 - limits["mean_distance"] else ""
            findings |= _state(HitFlags.INCONSISTENT, case, **figures, share=share)
    return findings


def compare_magnitude(frf: Frf, mean: Frf) -> float:
    """Return the share of a mean that an FRF of the same lines has, |sum A conj(B)| / sum |B|^2 of their accelerances.

    The peaks decide, not the noise of receptance at low frequencies.
    """
    low, high = frf.usable_band or (0.0, np.inf)
    lines = (frf.frequency >= low) & (frf.frequency <= high)
    weight = frf.frequency[lines] ** 2
    own, other = weight * frf.receptance[lines], weight * mean.receptance[lines]
    return float(np.abs(np.vdot(other, own)) / max(np.vdot(other, other).real, np.finfo(float).tiny))


def compute_distance_from_mean(frf: Frf, mean: Frf) -> tuple[float, float]:
    """Return the relative distance of a hit's FRF from the mean of other hits, and the distance that noise would give.

    A line counts with d = 2 |H - M| / (|H| + |M|), at most 2, and with the weight 1 / (0.05^2 + e^2). The variance of
    one hit against the mean of n hits is e^2 = (1 + 1/n) n/(n - 1) 2 n r^2, with the random error r of that mean
    (Bendat & Piersol). The results are the roots of the weighted means of d^2 and e^2.

    Raises ValueError where the lines differ, or the mean has fewer than 3 hits or no coherence.
    """
    error, n = mean.random_error, mean.n_averages
    if error is None:
        raise ValueError(f"the mean has {n} hit(s). The scatter of hits needs a mean of 3 or more hits with coherence.")
    if not np.array_equal(frf.frequency, mean.frequency):
        spans = [f"{response.frequency.size} lines up to {response.frequency[-1]:g} Hz" for response in (frf, mean)]
        found = f"the hit has {spans[0]}, the mean {spans[1]}"
        raise ValueError(f"{found}. Compare only hits with the same record length and sample rate.")
    reach = min(response.usable_band[1] if response.usable_band else np.inf for response in (frf, mean))
    used = mean.frequency <= reach
    hit, expected = frf.receptance[used], mean.receptance[used]
    scatter = np.minimum((1 + 1 / n) * n / (n - 1) * 2 * n * error[used] ** 2, 4.0)
    weight = 1 / (MIN_LINE_SCATTER**2 + scatter)
    distance = 2 * np.abs(hit - expected) / np.maximum(np.abs(hit) + np.abs(expected), np.finfo(float).tiny)
    return float(np.sqrt(np.average(distance**2, weights=weight))), float(np.sqrt(np.average(scatter, weights=weight)))


def _state(flag: HitFlags, case: str = "", **figures: object) -> Findings:
    return {flag: HIT_FAULTS[flag].state(case, **figures)}


def _evaluate_overloads(hit: Hit) -> Findings:
    findings: Findings = {}
    for i, flag in enumerate((HitFlags.OVERLOAD_FORCE, HitFlags.OVERLOAD_RESPONSE)):
        overload = find_overload(hit, i) if i or hit.has_force else None
        if overload is not None:
            note = " (inferred from the flat top of the signal)" if overload.inferred else ""
            findings |= _state(flag, level=overload.level, samples=overload.samples, note=note)
        elif hit.overload >> i & 1:
            findings |= _state(flag, "reported")
    return findings


def _evaluate_strength(hit: Hit, pulse: Pulse, *, clipped: bool) -> Findings:
    full = hit.channels[0].full_scale / abs(hit.channels[0].sensitivity) if hit.channels else np.inf
    soft, hard = HIT_FAULTS[HitFlags.TOO_SOFT].limits, HIT_FAULTS[HitFlags.TOO_HARD].limits
    if pulse.peak > hard["range_share"] * full and not clipped:
        return _state(HitFlags.TOO_HARD, peak=pulse.peak, share=pulse.peak / full, full=full)
    if hit.channels and pulse.peak < soft["range_share"] * full:
        return _state(HitFlags.TOO_SOFT, "range", peak=pulse.peak, full=full)
    if pulse.peak < soft["noise_ratio"] * pulse.baseline_rms:
        return _state(HitFlags.TOO_SOFT, "noise", peak=pulse.peak, noise=pulse.baseline_rms)
    return {}


def _evaluate_times(hit: Hit, missing: Findings, band: tuple[float, float] | None) -> Findings:
    return _evaluate_touches(hit, band) | ({} if missing else _evaluate_decay(hit))


def _evaluate_response_level(hit: Hit, pulse: Pulse) -> Findings:
    """Compare the response with its noise before the hit, and find hum and drift; a constant one is none either.

    The noise in a few samples before the hit is uncertain. The median of all tenths then confirms it.
    """
    response, limit = hit.acceleration, HIT_FAULTS[HitFlags.NO_RESPONSE].limits["noise_ratio"]
    if np.ptp(response) == 0:
        return _state(HitFlags.NO_RESPONSE, "constant")
    quiet, levels = response[: int(0.8 * count_pre_hit_samples(hit))], measure_levels(response)
    noise = float(np.std(quiet)) if quiet.size >= MIN_QUIET_SAMPLES else 0.0
    ratio = levels.max() / noise if noise else np.inf
    if levels.max() < limit * np.median(levels):
        ratio /= 1 + 2 / np.sqrt(2 * max(quiet.size, 1))
    if ratio < limit and pulse.width > MIN_LONG_PULSE * hit.sample_rate:
        return _state(HitFlags.NARROW_BAND, "long", length=1e3 * pulse.width / hit.sample_rate)
    if ratio < limit:
        return _state(HitFlags.NO_RESPONSE, ratio=ratio)
    is_missing = is_steady(response, quiet.size)
    return _state(HitFlags.NO_RESPONSE, "steady", level=float(np.std(response))) if is_missing else {}


def describe_highest_touch(hit: Hit) -> tuple[str, ...]:
    """Return the note on the highest further touch of a hit with a pulse; none below 2.5 % of the main pulse."""
    second = find_highest_touch(window_force(hit))
    if second is None:
        return ()
    return (join_sentences(TOUCH_TEXT.format(**_measure_touch(hit, second)), "The FRF includes it"),)


def _measure_touch(hit: Hit, touch: Touch) -> dict[str, object]:
    """Return the figures of a touch."""
    pulse = window_force(hit).pulse
    delay = (touch.peak_index - pulse.peak_index) / hit.sample_rate
    side = "after" if delay > 0 else "before"
    return {"delay": 1e3 * abs(delay), "side": side, "percent": 100 * touch.height / pulse.peak}


def _evaluate_touches(hit: Hit, band: tuple[float, float] | None) -> Findings:
    """Evaluate the force of a hit: the begin of its pulse, and whether a further touch does harm."""
    part, cut = window_force(hit), HIT_FAULTS[HitFlags.NO_HIT].limits["first_share"]
    first = float(part.pulse.force[0]) / part.pulse.peak
    if part.pulse.start == 0 and first > cut:
        return _state(HitFlags.NO_HIT, "cut", share=first)
    hole, second = find_force_hole(part, hit.sample_rate, band[1] if band else np.inf), find_highest_touch(part)
    if hole is not None and second is not None:
        return _state(HitFlags.DOUBLE_HIT, "hole", hole=hole, **_measure_touch(hit, second))
    if hole is not None:
        return _state(HitFlags.DOUBLE_HIT, "merged", hole=hole)
    late = next(filter(functools.partial(_is_too_late, hit), part.touches), None)
    return _state(HitFlags.DOUBLE_HIT, "late", **_measure_touch(hit, late)) if late else {}


def _is_too_late(hit: Hit, touch: Touch) -> bool:
    """Return whether the record cuts off the response to a touch in its second half.

    Of that response the record holds as much as of the response to the main pulse up to an earlier end. What is left of
    it there, times the relative height of the touch, may be as much as at the end of any hit.
    """
    pulse, limit = window_force(hit).pulse, HIT_FAULTS[HitFlags.NOT_DECAYED].limits["residual_share"]
    end = max(pulse.peak_index + hit.force.size - int(touch.peak_index), pulse.end + pulse.width)
    return end < touch.peak_index and touch.height * _measure_residual(hit, end)[0] > limit * pulse.peak


def _evaluate_response(hit: Hit) -> Findings:
    """Evaluate only the response: its strength, and whether its decay was hit again."""
    decay, noise = extract_free_decay(hit), measure_rest_noise(hit)
    peak = measure_swings(hit.acceleration)[1]
    if peak < HIT_FAULTS[HitFlags.TOO_SOFT].limits["noise_ratio"] * noise:
        return _state(HitFlags.TOO_SOFT, "response", peak=peak, noise=noise)
    second = find_second_input(decay, hit.sample_rate, noise)
    if second is None:
        return {}
    return _state(HitFlags.DOUBLE_HIT, "decay", delay=1e3 * (second + MAX_CONTACT_TIME))


def _evaluate_decay(hit: Hit) -> Findings:
    share, is_without_hum = _measure_residual(hit, hit.acceleration.size)
    case = "hum" if share and not is_without_hum and is_like_hum(hit) else ""
    return _state(HitFlags.NOT_DECAYED, case, share=share) if share else {}


def _measure_residual(hit: Hit, end: int) -> tuple[float, bool]:
    """Return the residual share of the response up to a sample, and whether hum was removed from it."""
    before = int(0.8 * count_pre_hit_samples(hit))
    share = _compute_residual_share(hit.acceleration[:end], before)
    hum = fit_mains_hum(hit, before) if share else None
    return (share, False) if hum is None else (_compute_residual_share((hit.acceleration - hum)[:end], before), True)


def _compute_residual_share(response: Floats, before: int) -> float:
    """Return the rms of the last tenth over that of the loudest tenth; 0 where it is small or mere noise."""
    limits = HIT_FAULTS[HitFlags.NOT_DECAYED].limits
    levels = measure_levels(response)
    quiet = response[:before]
    noise = float(np.std(quiet)) if quiet.size >= MIN_QUIET_SAMPLES else 0.0
    limit = max(limits["residual_share"] * levels.max(), limits["noise_ratio"] * noise)
    return 0.0 if levels[-1] <= limit else float(levels[-1] / levels.max())
