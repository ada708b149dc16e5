"""Evaluate one hit in time and frequency, and average the good hits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition.arrays import Floats
from acquisition.errors import DataError
from acquisition.estimation.estimate_frf import estimate_frf
from acquisition.frf import Frf
from acquisition.hit import Hit, HitFlags
from acquisition.hit_quality.double_hit import find_second_input, find_second_pulse
from acquisition.hit_quality.overload_and_hum import Overload, find_overload, fit_mains_hum, is_like_hum
from acquisition.hits.free_decay import MAX_CONTACT_TIME, extract_free_decay, measure_rest_noise
from acquisition.hits.pulse import Pulse, count_pre_hit_samples, extract_baseline, find_pulse


@dataclass(frozen=True)
class HitVerdict:
    """What is wrong with a hit, and what to do about it."""

    flags: HitFlags
    """Falsy where the hit may be averaged."""
    reasons: tuple[str, ...] = ()
    """One sentence a flag, in the order of the flags: what was found with its figures, and the cure."""

    @classmethod
    def from_findings(cls, findings: Mapping[HitFlags, str]) -> HitVerdict:
        """The verdict that says these findings (what was found, without the cure)."""
        flags = HitFlags.OK
        for flag in findings:
            flags |= flag
        return cls(flags, tuple(f"{findings[flag]}: {flag.cure[0].lower()}{flag.cure[1:]}" for flag in flags))

    @property
    def text(self) -> str:
        """All reasons in one text; empty for a good hit."""
        return " ".join(self.reasons)


MIN_LINE_SCATTER = 0.05
"""Relative scatter that no line is trusted below: it bounds the weight of a line."""


def compute_distance_from_mean(frf: Frf, mean: Frf) -> tuple[float, float]:
    """Relative distance of a hit's FRF from the mean where both reach, and what the noise alone would give.

    A line counts with d = 2 |H - M| / (|H| + |M|), which no line can drive beyond 2, and with the weight
    1 / (0.05^2 + e^2); e^2 = (1 + 1/n) n/(n - 1) 2 n r^2 is the variance of one hit against the mean of n, from the
    random error r of that mean. Root of the weighted mean of d^2; of e^2 for the noise. Source of r: Bendat & Piersol.

    Raises ValueError where the lines differ or the mean has fewer than 3 hits or no coherence.
    """
    error, n = mean.random_error, mean.n_averages
    if error is None:
        raise ValueError(f"a mean of {n} hits (with its coherence) cannot tell how far hits scatter; 3 are needed")
    if not np.array_equal(frf.frequency, mean.frequency):
        raise ValueError(
            f"the hit has {frf.frequency.size} lines up to {frf.frequency[-1]:g} Hz, the mean "
            f"{mean.frequency.size} up to {mean.frequency[-1]:g} Hz; compare hits of one set-up only"
        )
    reach = min(response.usable_band[1] if response.usable_band else np.inf for response in (frf, mean))
    used = mean.frequency <= reach
    hit, expected = frf.receptance[used], mean.receptance[used]
    scatter = np.minimum((1 + 1 / n) * n / (n - 1) * 2 * n * error[used] ** 2, 4.0)
    weight = 1 / (MIN_LINE_SCATTER**2 + scatter)
    apart = 2 * np.abs(hit - expected) / np.maximum(np.abs(hit) + np.abs(expected), np.finfo(float).tiny)
    return float(np.sqrt(np.average(apart**2, weights=weight))), float(np.sqrt(np.average(scatter, weights=weight)))


MAX_MEAN_DISTANCE = 0.3
"""Distance from the mean that makes a hit inconsistent: it would move a mean of ten by 3 % ..."""
MEAN_DISTANCE_NOISE_RATIO = 4.0
"""... and at least this many times what the scatter of the hits in the mean would give."""


def evaluate_spectrum(hit: Hit, mean: Frf | None, band: tuple[float, float] | None = None) -> dict[HitFlags, str]:
    """What is wrong with a hit in the frequency domain, by flag: TOO_SOFT, NARROW_BAND, INCONSISTENT.

    mean: of other good hits, None or fewer than 3 where it is not to be compared; band: that the force must reach to
    the end of (Hz).
    """
    frf = estimate_frf([hit])
    start, reach = frf.usable_band or (0.0, np.inf)
    if reach <= start:
        return {HitFlags.TOO_SOFT: f"The force at {start:.3g} Hz is 20 dB below its largest value: no line can be used"}
    findings = {}
    if band is not None and reach < band[1]:
        findings[HitFlags.NARROW_BAND] = f"The force reaches to {reach:.0f} Hz (-20 dB) of the {band[1]:g} Hz wanted"
    if mean is not None and mean.random_error is not None:
        distance, noise = compute_distance_from_mean(frf, mean)
        limit = max(MAX_MEAN_DISTANCE, MEAN_DISTANCE_NOISE_RATIO * noise)
        if distance > limit:
            findings[HitFlags.INCONSISTENT] = (
                f"FRF {distance:.0%} away from the mean of {mean.n_averages} hits (limit {limit:.0%})"
            )
    return findings


MAX_FORCE_RANGE_SHARE = 0.9
"""A pulse above this share of the force range is too hard: the sensor may saturate before its converter does."""
MIN_FORCE_RANGE_SHARE = 0.02
"""A pulse below this share of the force range is too soft: the converter's steps show."""
MIN_PULSE_NOISE_RATIO = 20.0
"""A pulse below this many times the baseline's rms is too soft."""
MAX_RESIDUAL_SHARE = 0.02
"""rms of the last tenth of the response against that of the loudest: above this and twice the noise it was cut off."""


def evaluate_hit(hit: Hit, mean: Frf | None = None, band: tuple[float, float] | None = None) -> HitVerdict:
    """All that is wrong with a hit; its flags are falsy when it may be averaged.

    Without `mean` and `band` the time signals alone decide. With the mean of 3 or more good hits, one without other
    faults is compared with it (INCONSISTENT); with the band that is followed (Hz), its force must reach to the end of
    it (NARROW_BAND: 20 dB below its largest value). With either, it must reach over two lines (TOO_SOFT). A hit whose
    force was not measured is judged by its response alone. Source: ISO 7626-5 practice; docs/hit-verdicts.md.

    >>> time = np.arange(-100, 4000) / 10240.0
    >>> pulse = np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)
    >>> structure = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    >>> hit = Hit(200 * pulse, 200 * structure.response(time, 1e-3), 10240.0, 100)
    >>> evaluate_hit(hit).flags == HitFlags.OK
    True
    >>> print(evaluate_hit(hit, band=(200.0, 4000.0)).text)
    The force reaches to 2220 Hz (-20 dB) of the 4000 Hz wanted: use a harder hammer tip.
    """
    findings = _evaluate_overloads(hit)
    if hit.lost_scans:
        findings[HitFlags.LOST_SCANS] = f"{hit.lost_scans} scans are missing in this record"
    if not hit.has_force:
        return HitVerdict.from_findings(findings | ({} if findings else _evaluate_response(hit)) | _evaluate_decay(hit))
    if _is_swapped(hit):
        findings[HitFlags.SWAPPED_CHANNELS] = "The force rings and the response does not"
        return HitVerdict.from_findings(findings)
    pulse = find_pulse(hit)
    if pulse is None:
        findings[HitFlags.NO_HIT] = "No hammer pulse stands out of the noise of the force"
        return HitVerdict.from_findings(findings)
    findings |= _evaluate_strength(hit, pulse, clipped=HitFlags.OVERLOAD_FORCE in findings)
    findings |= _evaluate_double_hit(hit, pulse) | _evaluate_decay(hit)
    if band is not None or (mean is not None and not findings):
        findings |= evaluate_spectrum(hit, mean if not findings else None, band)
    return HitVerdict.from_findings(findings)


def _evaluate_overloads(hit: Hit) -> dict[HitFlags, str]:
    flags = (HitFlags.OVERLOAD_FORCE, HitFlags.OVERLOAD_RESPONSE)
    overloads = {flag: find_overload(hit, i) for i, flag in enumerate(flags) if i or hit.has_force}
    texts = {flag: _format_overload(flag, overload) for flag, overload in overloads.items() if overload is not None}
    reported = {flag: "The device reports an overload" for i, flag in enumerate(flags) if hit.overload >> i & 1}
    return reported | texts


def _format_overload(flag: HitFlags, overload: Overload) -> str:
    name, unit = ("Force", "N") if flag is HitFlags.OVERLOAD_FORCE else ("Response", "m/s^2")
    note = " (inferred from its flat top)" if overload.inferred else ""
    return f"{name} cut off at {overload.level:.4g} {unit} for {overload.samples} samples{note}"


def _is_swapped(hit: Hit) -> bool:
    """The response is one short pulse of one sign while the force swings through both."""
    force, response = hit.force - np.median(hit.force), hit.acceleration - np.median(hit.acceleration)
    noise = float(np.std(extract_baseline(response, hit.pre_trigger)))
    sided = min(response.max(), -response.min()) < max(0.1 * np.max(np.abs(response)), 6 * noise)
    swings = min(force.max(), -force.min()) > 0.3 * np.max(np.abs(force))
    return bool(sided and swings and _measure_energy_duration(force) > 3 * _measure_energy_duration(response))


def _measure_energy_duration(signal: Floats) -> int:
    """Number of samples that hold the middle 90 % of the energy."""
    energy = np.cumsum(signal**2)
    low, high = np.searchsorted(energy, [0.05 * energy[-1], 0.95 * energy[-1]])
    return int(high - low) + 1


def _evaluate_strength(hit: Hit, pulse: Pulse, *, clipped: bool) -> dict[HitFlags, str]:
    full = hit.channels[0].full_scale / abs(hit.channels[0].sensitivity) if hit.channels else np.inf
    peak = f"Peak of {pulse.peak:.4g} N is"
    if pulse.peak > MAX_FORCE_RANGE_SHARE * full and not clipped:
        return {HitFlags.TOO_HARD: f"{peak} {pulse.peak / full:.0%} of the range of {full:.0f} N"}
    if hit.channels and pulse.peak < MIN_FORCE_RANGE_SHARE * full:
        return {HitFlags.TOO_SOFT: f"{peak} below {MIN_FORCE_RANGE_SHARE:.0%} of the range of {full:.0f} N"}
    if pulse.peak < MIN_PULSE_NOISE_RATIO * pulse.baseline_rms:
        return {
            HitFlags.TOO_SOFT: f"{peak} below {MIN_PULSE_NOISE_RATIO:.0f} times the noise of {pulse.baseline_rms:.3g} N"
        }
    return {}


def _evaluate_double_hit(hit: Hit, pulse: Pulse) -> dict[HitFlags, str]:
    second = find_second_pulse(pulse)
    if second is None:
        return {}
    when = (
        f"{abs(second.delay) / hit.sample_rate * 1e3:.2g} ms {'after' if second.delay > 0 else 'before'} the main one"
    )
    return {HitFlags.DOUBLE_HIT: f"Second peak {when} ({100 * second.share:.2g} %)"}


def _evaluate_response(hit: Hit) -> dict[HitFlags, str]:
    """What the response alone tells of a hit: whether it stands out, and whether its decay was hit again."""
    decay, noise = extract_free_decay(hit), measure_rest_noise(hit)
    peak = float(np.max(np.abs(hit.acceleration - np.median(hit.acceleration))))
    if peak < MIN_PULSE_NOISE_RATIO * noise:
        text = f"Response of {peak:.3g} m/s^2 is below {MIN_PULSE_NOISE_RATIO:.0f} times the noise of {noise:.2g} m/s^2"
        return {HitFlags.TOO_SOFT: text}
    again = find_second_input(decay, hit.sample_rate, noise)
    if again is None:
        return {}
    when = 1e3 * (again + MAX_CONTACT_TIME)
    return {HitFlags.DOUBLE_HIT: f"The decay is disturbed {when:.2g} ms after the hit, as by a second touch"}


def _evaluate_decay(hit: Hit) -> dict[HitFlags, str]:
    before = int(0.8 * count_pre_hit_samples(hit))
    share = _compute_residual_share(hit.acceleration, before)
    if share == 0:
        return {}
    hum = fit_mains_hum(hit, before)
    if hum is not None:
        share = _compute_residual_share(hit.acceleration - hum, before)
    text = f"The last tenth of the record still rings with {share:.1%} of the loudest"
    if hum is None and is_like_hum(hit):
        text += "; it sounds like mains hum, which 20 ms before the hit would prove"
    return {HitFlags.NOT_DECAYED: text} if share else {}


def _compute_residual_share(response: Floats, before: int) -> float:
    """rms of the last tenth over that of the loudest; 0 where it is small, or noise as before the hit."""
    levels = [float(np.std(tenth)) for tenth in np.array_split(response, 10)]
    quiet = response[:before]
    noise = float(np.std(quiet)) if quiet.size >= 8 else 0.0
    return 0.0 if levels[-1] <= max(MAX_RESIDUAL_SHARE * max(levels), 2 * noise) else levels[-1] / max(levels)


def check_hit(hit: Hit) -> HitFlags:
    """All that is wrong with a hit, from its time signals alone; falsy when it may be averaged. See `evaluate_hit`.

    >>> time = np.arange(-100, 4000) / 10240.0
    >>> pulse = np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)
    >>> structure = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    >>> response = 200 * structure.response(time, 1e-3)
    >>> again = 80 * np.roll(pulse, 60)  # N, 6 ms later
    >>> [check_hit(Hit(force, response, 10240.0, 100)).words for force in (200 * pulse, 200 * pulse + again)]
    ['good', 'double hit']
    """
    return evaluate_hit(hit).flags


def average_good_hits(hits: Sequence[Hit]) -> tuple[Frf | None, tuple[HitFlags, ...]]:
    """H1 FRF of the good hits, None without their force, and the verdict on each.

    DataError with the reasons where no hit is good.

    >>> time = np.arange(-100, 4000) / 10240.0
    >>> pulse = np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)
    >>> structure = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    >>> response = 200 * structure.response(time, 1e-3)
    >>> forces = 200 * pulse, 200 * pulse + 80 * np.roll(pulse, 60), 201 * pulse
    >>> frf, flags = average_good_hits([Hit(force, response, 10240.0, 100) for force in forces])
    >>> frf.n_averages, [flag.words for flag in flags]
    (2, ['good', 'double hit', 'good'])
    """
    verdicts = [evaluate_hit(hit) for hit in hits]
    good = [hit for hit, verdict in zip(hits, verdicts, strict=True) if not verdict.flags]
    if not good:
        reasons = "; ".join(f"hit {i}: {verdict.flags.words}. {verdict.text}" for i, verdict in enumerate(verdicts, 1))
        raise DataError(f"no good hit of {len(hits)}: {reasons}")
    return estimate_frf(good) if good[0].has_force else None, tuple(verdict.flags for verdict in verdicts)
