"""Detect clipped signals and mains hum in a hit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acquisition.arrays import Floats
from acquisition.hit import Hit
from acquisition.hits.pulse import count_pre_hit_samples, extract_baseline

MIN_RAIL_SAMPLES = 3
"""Samples at a rail of the converter, or in a row at the extreme value of one without codes."""
FLAT_TOP_SHARE = 0.7
"""Share of the samples of a band below the maximum in its uppermost third: a round top has 1/sqrt(3) = 0.58 ..."""
FLAT_TOP_SAMPLES = 2.5
"""... and a flat one this many samples more than that."""
FLAT_TOP_SCALES = (1.0, 0.25, 0.0625)
"""Half widths of the uppermost third, in 3 times the noise before the hit; a saturated amplifier cuts that off too."""

STEP_SEARCH_SAMPLES = 1024
"""Samples that are looked at first for steps finer than any that are believed."""
MIN_STEP_SHARE = 1e-4
"""Finest step, as a share of the maximum, that is believed of a recording without codes."""


@dataclass(frozen=True)
class Overload:
    """A cut-off signal."""

    level: float
    """Level at which it was cut off (N or m/s^2)."""
    samples: int
    """Number of samples there."""
    inferred: bool
    """Whether this is told by the shape of the signal, not by the codes at the rail of the converter."""


def find_overload(hit: Hit, index: int) -> Overload | None:
    """Overload of the force (index 0) or of the response (1); None where there is none.

    Certain: three codes at one rail. Inferred: the extreme value three times in a row in a recording without codes
    whose steps are not that coarse; or a flat top, as an amplifier makes it that saturates before the converter does,
    with noise on top.
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
    middle = float(np.median(signal))
    noise = float(np.std(extract_baseline(signal, count_pre_hit_samples(hit))))
    for sign in (1, -1):
        above = sign * (signal - middle)
        step = abs(scale) or _find_finest_step(above)
        count = max(_count_flat_top(above, 3 * noise * share + step) for share in FLAT_TOP_SCALES)
        count = count or (0 if scale else _count_at_rail(above, step))
        if count >= MIN_RAIL_SAMPLES and above.max() > 0:
            return Overload(middle + sign * float(above.max()), count, inferred=True)
    return None


def _count_flat_top(above: Floats, half: float) -> int:
    """Samples of a flat top whose noise stays within +-half of it; 0 where the top is round.

    Of a round top, whatever its width, the band below the maximum holds 1/sqrt(3) of the samples that one three
    times as deep holds; of a cut one nearly all. Neither can be told where the signal is not well above its noise.
    """
    top = float(above.max())
    if top <= 8 * half:
        return 0
    inside, deeper = (int(np.count_nonzero(above > top - bands * half)) for bands in (2, 6))
    flat = inside >= FLAT_TOP_SHARE * deeper and inside >= deeper / np.sqrt(3) + FLAT_TOP_SAMPLES
    return inside if flat else 0


def _find_finest_step(above: Floats) -> float:
    """Smallest step between two values: that of the converter; at least that of four written digits."""
    top = float(above.max())
    for part in (above[:STEP_SEARCH_SAMPLES], above):
        step = float(np.min(np.diff(np.unique(part)), initial=top))
        if step <= MIN_STEP_SHARE * top:
            break
    return max(step, MIN_STEP_SHARE * top)


def _count_at_rail(above: Floats, step: float) -> int:
    """Samples at the maximum where it stands three times in a row; 0 where it does so because the steps are coarse.

    The three steps below the one that holds a round top together hold at least as many samples as that one.
    """
    equal = above == above.max()
    in_a_row = np.convolve(equal, np.ones(MIN_RAIL_SAMPLES), "valid").max() >= MIN_RAIL_SAMPLES
    count = int(np.count_nonzero(equal))
    near = int(np.count_nonzero(above > above.max() - 3.5 * step))
    return count if in_a_row and near <= 1.5 * count else 0


MAINS_FREQUENCIES = (50.0, 60.0)
"""Frequencies of the mains (Hz)."""
MAINS_HARMONICS = 5
"""Multiples of them that hum has."""
HUM_TAIL_SHARE = 0.2
"""Share of the record at its end that hum is looked for in."""
MAX_UNEXPLAINED_VARIANCE = 0.5
"""Share of the variance that hum leaves at most, before the hit and at the end of the record."""
MIN_HUM_SAMPLES = 8
"""Samples before the hit that are too few to tell."""


def fit_mains_hum(hit: Hit, before: int) -> Floats | None:
    """Tones at 50 or 60 Hz and their multiples in the response (m/s^2), shape (n,); None where there is no hum.

    before: samples that stand before the hit. Hum goes on through the hit with one phase: the same tones must stand in
    these samples and in the last fifth of the record, and be most of what is there. What rings after the hit was not
    there before it.
    """
    quiet, tail = slice(0, before), slice(int((1 - HUM_TAIL_SHARE) * hit.acceleration.size), None)
    if before < MIN_HUM_SAMPLES:
        return None
    tones = (_fit_tones(hit, mains, quiet, tail) for mains in MAINS_FREQUENCIES)
    fitting = [tone for tone in tones if all(_is_mostly_tone(tone, hit.acceleration, part) for part in (quiet, tail))]
    return min(fitting, key=lambda tone: float(np.var((hit.acceleration - tone)[tail])), default=None)


def is_like_hum(hit: Hit) -> bool:
    """Whether the last two fifths of the response are mostly steady tones at multiples of the mains, proved or not."""
    size = hit.acceleration.size
    last, last_two = slice(int((1 - HUM_TAIL_SHARE) * size), None), slice(int((1 - 2 * HUM_TAIL_SHARE) * size), None)
    tones = (_fit_tones(hit, mains, last_two) for mains in MAINS_FREQUENCIES)
    return any(_is_mostly_tone(tone, hit.acceleration, last) for tone in tones)


def _fit_tones(hit: Hit, mains: float, *parts: slice) -> Floats:
    """Multiples of this frequency (Hz) that fit these parts together, over the whole record."""
    angle = (
        2
        * np.pi
        * mains
        * np.arange(1, MAINS_HARMONICS + 1)
        * (np.arange(hit.acceleration.size) / hit.sample_rate)[:, None]
    )
    waves = np.hstack([np.cos(angle), np.sin(angle)])
    known = np.concatenate([waves[part] for part in parts])
    columns = np.column_stack([known, np.ones(len(known))])
    values = np.concatenate([hit.acceleration[part] for part in parts])
    return np.asarray(waves @ np.linalg.lstsq(columns, values, rcond=None)[0][:-1])


def _is_mostly_tone(tone: Floats, signal: Floats, part: slice) -> bool:
    return bool(np.var((signal - tone)[part]) <= MAX_UNEXPLAINED_VARIANCE * np.var(signal[part]))
