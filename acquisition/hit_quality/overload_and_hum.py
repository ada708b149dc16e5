"""Detect clipped signals and mains hum in a hit."""

from dataclasses import dataclass

import numpy as np

from acquisition.arrays import Floats, find_median
from acquisition.hit import Hit
from acquisition.hits.pulse import count_pre_hit_samples, extract_baseline

MIN_RAIL_SAMPLES = 3
"""Smallest number of samples at a rail, or in a row at the extreme value of a converter without codes."""
FLAT_TOP_SHARE = 0.7
"""Share of a band's samples in its uppermost third, from which a top is flat; a round top has 1/sqrt(3) = 0.58."""
FLAT_TOP_SAMPLES = 2.5
"""Number of samples by which a flat top exceeds that share."""
FLAT_TOP_SCALES = (1.0, 0.25, 0.0625)
"""Half widths of the uppermost third, in 3 times the noise before the hit; a saturated amplifier clips the noise too.
"""

STEP_SEARCH_SAMPLES = 1024
"""Number of samples that are searched first for a step finer than any credible one."""
MIN_STEP_SHARE = 1e-4
"""Finest credible step of a recording without codes, as a share of the maximum."""


@dataclass(frozen=True)
class Overload:
    """Clipped signal."""

    level: float
    """Level at which it was clipped (N or m/s^2)."""
    samples: int
    """Number of samples at that level."""
    inferred: bool
    """True if the shape of the signal shows it instead of codes at the rail of the converter."""


def find_overload(hit: Hit, index: int) -> Overload | None:
    """Find an overload of the force (index 0) or of the response (1); None without one.

    Certain: three codes at one rail. Inferred: the extreme value three times in a row in a recording without codes and
    with finer steps; or a flat top with noise on it, as an amplifier makes that saturates before its converter.
    """
    signal = np.asarray((hit.force, hit.acceleration)[index])
    scale, row = 0.0, index if hit.has_force else 0
    if hit.codes is not None and hit.channels is not None:
        codes, channel = hit.codes[row], hit.channels[row]
        low, high = channel.effective_rails(codes)
        for rail, beyond in ((low, codes <= low), (high, codes >= high)):
            count = int(np.count_nonzero(beyond))
            if count >= MIN_RAIL_SAMPLES:
                return Overload(rail * channel.scale, count, inferred=False)
        scale = channel.scale * channel.effective_code_step(codes)
    middle = find_median(signal)
    noise = float(np.std(extract_baseline(signal, count_pre_hit_samples(hit))))
    above = signal - middle
    for sign in (1, -1):
        top = float(above.max())
        step = abs(scale) or _find_finest_step(above, top)
        halves = [half for share in FLAT_TOP_SCALES if top > 8 * (half := 3 * noise * share + step)]
        upper = above[above > top - 6 * halves[0]] if halves else above[:0]
        count = max((_count_flat_top(upper, top, half) for half in halves), default=0)
        count = count or (0 if scale else _count_at_rail(above, top, step))
        if count >= MIN_RAIL_SAMPLES and top > 0:
            return Overload(middle + sign * top, count, inferred=True)
        above = -above
    return None


def _count_flat_top(upper: Floats, top: float, half: float) -> int:
    """Count the samples of a flat top whose noise stays within +-half of it; 0 where the top is round.

    The band below a round maximum of any width holds 1/sqrt(3) of the samples of a band three times as deep. Of a flat
    top it holds nearly all. Neither can be seen where the signal is not well above its noise. upper: all samples at
    most 6 half below the top.
    """
    inside, deeper = (int(np.count_nonzero(upper > top - bands * half)) for bands in (2, 6))
    flat = inside >= FLAT_TOP_SHARE * deeper and inside >= deeper / np.sqrt(3) + FLAT_TOP_SAMPLES
    return inside if flat else 0


def _find_finest_step(above: Floats, top: float) -> float:
    """Return the smallest step between two values, that of the converter; at least that of four written digits."""
    for part in (above[:STEP_SEARCH_SAMPLES], above):
        steps = np.diff(np.sort(part))
        step = float(np.min(steps[steps > 0], initial=top))
        if step <= MIN_STEP_SHARE * top:
            break
    return max(step, MIN_STEP_SHARE * top)


def _count_at_rail(above: Floats, top: float, step: float) -> int:
    """Count the samples at a maximum held three times in a row; 0 where the steps are coarse.

    The three steps below the one that holds a round top together hold at least as many samples.
    """
    equal = np.flatnonzero(above == top)
    span = MIN_RAIL_SAMPLES - 1
    if not np.any(equal[span:] - equal[:-span] == span):
        return 0
    near = int(np.count_nonzero(above > top - 3.5 * step))
    return equal.size if near <= 1.5 * equal.size else 0


MAINS_FREQUENCIES = (50.0, 60.0)
"""Frequencies of the mains (Hz)."""
MAINS_HARMONICS = 5
"""Number of harmonics of hum."""
HUM_TAIL_SHARE = 0.2
"""Share of the record at its end that is searched for hum."""
MAX_UNEXPLAINED_VARIANCE = 0.5
"""Largest share of the variance that hum leaves, before the hit and at the end of the record."""
MIN_HUM_SAMPLES = 8
"""Smallest number of samples before the hit."""


def fit_mains_hum(hit: Hit, before: int) -> Floats | None:
    """Fit tones at 50 or 60 Hz and their harmonics to the response (m/s^2), shape (n,); None without hum.

    before: samples ahead of the hit. Hum goes on through the hit with one phase: the same tones must make up most of
    these samples and of the last fifth of the record. Ringing after the hit was not there before it.
    """
    quiet, tail = slice(0, before), slice(int((1 - HUM_TAIL_SHARE) * hit.acceleration.size), None)
    if before < MIN_HUM_SAMPLES:
        return None
    hums = [_fit_hum(hit, mains, quiet, tail) for mains in MAINS_FREQUENCIES]
    fitting = [hum for hum in hums if all(_is_mostly_hum(hum, hit, part) for part in (quiet, tail))]
    best = min(fitting, key=lambda hum: float(np.var(_subtract_hum(hum, hit, tail))), default=None)
    return None if best is None else best.compute(hit, slice(None))


def is_like_hum(hit: Hit) -> bool:
    """Return whether the last two fifths of the response are mostly harmonics of the mains, proved or not."""
    size = hit.acceleration.size
    last, last_two = slice(int((1 - HUM_TAIL_SHARE) * size), None), slice(int((1 - 2 * HUM_TAIL_SHARE) * size), None)
    return any(_is_mostly_hum(_fit_hum(hit, mains, last_two), hit, last) for mains in MAINS_FREQUENCIES)


@dataclass(frozen=True, eq=False)
class _Hum:
    """Harmonics of a frequency in the response of a hit."""

    mains: float
    """Frequency (Hz)."""
    amplitudes: Floats
    """Amplitudes of the cosines, then of the sines (m/s^2)."""

    def compute(self, hit: Hit, part: slice) -> Floats:
        """Return the hum in a part of the record (m/s^2)."""
        return np.asarray(_compute_harmonics(hit, self.mains, part) @ self.amplitudes)


def _compute_harmonics(hit: Hit, mains: float, part: slice) -> Floats:
    """Return cosines and sines of a frequency (Hz) and its harmonics in a part of a record, one per column."""
    time = np.arange(hit.acceleration.size)[part] / hit.sample_rate
    waves = np.cumprod(np.exp(2j * np.pi * mains * time)[:, None].repeat(MAINS_HARMONICS, axis=1), axis=1)
    return np.hstack([waves.real, waves.imag])


def _fit_hum(hit: Hit, mains: float, *parts: slice) -> _Hum:
    """Fit harmonics of a frequency (Hz) and an offset to these parts together."""
    known = np.concatenate([_compute_harmonics(hit, mains, part) for part in parts])
    columns = np.column_stack([known, np.ones(len(known))])
    values = np.concatenate([hit.acceleration[part] for part in parts])
    return _Hum(mains, np.linalg.lstsq(columns, values, rcond=None)[0][:-1])


def _subtract_hum(hum: _Hum, hit: Hit, part: slice) -> Floats:
    return hit.acceleration[part] - hum.compute(hit, part)


def _is_mostly_hum(hum: _Hum, hit: Hit, part: slice) -> bool:
    return bool(np.var(_subtract_hum(hum, hit, part)) <= MAX_UNEXPLAINED_VARIANCE * np.var(hit.acceleration[part]))
