"""The verdict on one hit: everything that speaks against averaging it, with figures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acquisition.frf import Frf
from acquisition.hit import Hit, HitFlags
from acquisition.hits.free_decay import HIT_ENDS, free_decay, resting_noise
from acquisition.hits.pulse import Pulse, baseline, find_pulse, samples_before
from acquisition.verdicts.by_spectrum import by_spectrum
from acquisition.verdicts.find_overload import Overload, find_overload
from acquisition.verdicts.mains_hum import mains_hum, sounds_like_hum
from acquisition.verdicts.second_input import second_input
from acquisition.verdicts.second_touch import find_second_touch
from acquisition.verdicts.verdict import HitVerdict

HARD_SHARE_OF_SCALE = 0.9
"""A pulse above this share of the force range is too hard: the sensor may saturate before its converter does."""
SOFT_SHARE_OF_SCALE = 0.02
"""A pulse below this share of the force range is too soft: the converter's steps show."""
SOFT_NOISE_RATIO = 20.0
"""A pulse below this many times the baseline's rms is too soft."""
DECAYED_SHARE = 0.02
"""rms of the last tenth of the response against that of the loudest: above this and twice the noise it was cut off."""


def judge_hit(hit: Hit, mean: Frf | None = None, band: tuple[float, float] | None = None) -> HitVerdict:
    """All that is wrong with a hit; its flags are falsy when it may be averaged.

    Without `mean` and `band` the time signals alone decide. With the mean of 3 or more good hits, one without other
    faults is compared with it (INCONSISTENT); with the band that is followed (Hz), its force must reach to the end of
    it (NARROW_BAND: 20 dB below its largest value). With either, it must reach over two lines (TOO_SOFT). A hit whose
    force was not measured is judged by its response alone. Source: ISO 7626-5 practice; docs/hit-verdicts.md.

    >>> time = np.arange(-100, 4000) / 10240.0
    >>> pulse = np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)
    >>> structure = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    >>> hit = Hit(200 * pulse, 200 * structure.response(time, 1e-3), 10240.0, 100)
    >>> judge_hit(hit).flags == HitFlags.OK
    True
    >>> print(judge_hit(hit, band=(200.0, 4000.0)).text)
    The force reaches to 2220 Hz (-20 dB) of the 4000 Hz wanted: use a harder hammer tip.
    """
    findings = _overloads(hit)
    if hit.lost_scans:
        findings[HitFlags.LOST_SCANS] = f"{hit.lost_scans} scans are missing in this record"
    if not hit.has_force:
        return HitVerdict.of(findings | ({} if findings else _by_response(hit)) | _cut_off(hit))
    if _is_swapped(hit):
        findings[HitFlags.SWAPPED_CHANNELS] = "The force rings and the response does not"
        return HitVerdict.of(findings)
    pulse = find_pulse(hit)
    if pulse is None:
        findings[HitFlags.NO_HIT] = "No hammer pulse stands out of the noise of the force"
        return HitVerdict.of(findings)
    findings |= _strength(hit, pulse, clipped=HitFlags.OVERLOAD_FORCE in findings)
    findings |= _second(hit, pulse) | _cut_off(hit)
    if band is not None or (mean is not None and not findings):
        findings |= by_spectrum(hit, mean if not findings else None, band)
    return HitVerdict.of(findings)


def _overloads(hit: Hit) -> dict[HitFlags, str]:
    flags = (HitFlags.OVERLOAD_FORCE, HitFlags.OVERLOAD_RESPONSE)
    overloads = {flag: find_overload(hit, i) for i, flag in enumerate(flags) if i or hit.has_force}
    texts = {flag: _overload_text(flag, overload) for flag, overload in overloads.items() if overload is not None}
    reported = {flag: "The device reports an overload" for i, flag in enumerate(flags) if hit.overload >> i & 1}
    return reported | texts


def _overload_text(flag: HitFlags, overload: Overload) -> str:
    name, unit = ("Force", "N") if flag is HitFlags.OVERLOAD_FORCE else ("Response", "m/s^2")
    note = " (inferred from its flat top)" if overload.inferred else ""
    return f"{name} cut off at {overload.level:.4g} {unit} for {overload.samples} samples{note}"


def _is_swapped(hit: Hit) -> bool:
    """The response is one short pulse of one sign while the force swings through both."""
    force, response = hit.force - np.median(hit.force), hit.acceleration - np.median(hit.acceleration)
    noise = float(np.std(baseline(response, hit.pre_trigger)))
    sided = min(response.max(), -response.min()) < max(0.1 * np.max(np.abs(response)), 6 * noise)
    swings = min(force.max(), -force.min()) > 0.3 * np.max(np.abs(force))
    return bool(sided and swings and _duration(force) > 3 * _duration(response))


def _duration(signal: NDArray[np.float64]) -> int:
    """Number of samples that hold the middle 90 % of the energy."""
    energy = np.cumsum(signal**2)
    low, high = np.searchsorted(energy, [0.05 * energy[-1], 0.95 * energy[-1]])
    return int(high - low) + 1


def _strength(hit: Hit, pulse: Pulse, *, clipped: bool) -> dict[HitFlags, str]:
    full = hit.channels[0].full_scale / abs(hit.channels[0].sensitivity) if hit.channels else np.inf
    peak = f"Peak of {pulse.peak:.4g} N is"
    if pulse.peak > HARD_SHARE_OF_SCALE * full and not clipped:
        return {HitFlags.TOO_HARD: f"{peak} {pulse.peak / full:.0%} of the range of {full:.0f} N"}
    if hit.channels and pulse.peak < SOFT_SHARE_OF_SCALE * full:
        return {HitFlags.TOO_SOFT: f"{peak} below {SOFT_SHARE_OF_SCALE:.0%} of the range of {full:.0f} N"}
    if pulse.peak < SOFT_NOISE_RATIO * pulse.baseline_rms:
        return {HitFlags.TOO_SOFT: f"{peak} below {SOFT_NOISE_RATIO:.0f} times the noise of {pulse.baseline_rms:.3g} N"}
    return {}


def _second(hit: Hit, pulse: Pulse) -> dict[HitFlags, str]:
    second = find_second_touch(pulse)
    if second is None:
        return {}
    when = (
        f"{abs(second.delay) / hit.sample_rate * 1e3:.2g} ms {'after' if second.delay > 0 else 'before'} the main one"
    )
    return {HitFlags.DOUBLE_HIT: f"Second peak {when} ({100 * second.share:.2g} %)"}


def _by_response(hit: Hit) -> dict[HitFlags, str]:
    """What the response alone tells of a hit: whether it stands out, and whether its decay was hit again."""
    decay, noise = free_decay(hit), resting_noise(hit)
    peak = float(np.max(np.abs(hit.acceleration - np.median(hit.acceleration))))
    if peak < SOFT_NOISE_RATIO * noise:
        text = f"Response of {peak:.3g} m/s^2 is below {SOFT_NOISE_RATIO:.0f} times the noise of {noise:.2g} m/s^2"
        return {HitFlags.TOO_SOFT: text}
    again = second_input(decay, hit.sample_rate, noise)
    if again is None:
        return {}
    when = 1e3 * (again + HIT_ENDS)
    return {HitFlags.DOUBLE_HIT: f"The decay is disturbed {when:.2g} ms after the hit, as by a second touch"}


def _cut_off(hit: Hit) -> dict[HitFlags, str]:
    before = int(0.8 * samples_before(hit))
    share = _left(hit.acceleration, before)
    if share == 0:
        return {}
    hum = mains_hum(hit, before)
    if hum is not None:
        share = _left(hit.acceleration - hum, before)
    text = f"The last tenth of the record still rings with {share:.1%} of the loudest"
    if hum is None and sounds_like_hum(hit):
        text += "; it sounds like mains hum, which 20 ms before the hit would prove"
    return {HitFlags.NOT_DECAYED: text} if share else {}


def _left(response: NDArray[np.float64], before: int) -> float:
    """rms of the last tenth over that of the loudest; 0 where it is small, or noise as before the hit."""
    levels = [float(np.std(tenth)) for tenth in np.array_split(response, 10)]
    quiet = response[:before]
    noise = float(np.std(quiet)) if quiet.size >= 8 else 0.0
    return 0.0 if levels[-1] <= max(DECAYED_SHARE * max(levels), 2 * noise) else levels[-1] / max(levels)
