"""Where a signal was cut off by its converter or by the amplifier before it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.hit import Hit
from acquisition.hits.pulse import baseline, samples_before

RAIL_SAMPLES = 3
"""Samples at a rail of the converter, or in a row at the extreme value of one without codes."""
FLAT_SHARE = 0.7
"""Share of the samples of a band below the maximum in its uppermost third: a round top has 1/sqrt(3) = 0.58 ..."""
FLAT_SAMPLES = 2.5
"""... and a flat one this many samples more than that."""
SCALES = (1.0, 0.25, 0.0625)
"""Half widths of the uppermost third, in 3 times the noise before the hit; a saturated amplifier cuts that off too."""

FEW = 1024
"""Samples that are looked at first for steps finer than any that are believed."""
DIGITS = 1e-4
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
        low, high = channel.rails_in(codes)
        for rail, beyond in ((low, codes <= low), (high, codes >= high)):
            count = int(np.count_nonzero(beyond))
            if count >= RAIL_SAMPLES:
                return Overload(rail * channel.scale, count, inferred=False)
        scale = channel.scale * channel.step_in(codes)
    middle = float(np.median(signal))
    noise = float(np.std(baseline(signal, samples_before(hit))))
    for sign in (1, -1):
        above = sign * (signal - middle)
        step = abs(scale) or _finest_step(above)
        count = max(_flat_top(above, 3 * noise * share + step) for share in SCALES)
        count = count or (0 if scale else _at_a_rail(above, step))
        if count >= RAIL_SAMPLES and above.max() > 0:
            return Overload(middle + sign * float(above.max()), count, inferred=True)
    return None


def _flat_top(above: NDArray[np.float64], half: float) -> int:
    """Samples of a flat top whose noise stays within +-half of it; 0 where the top is round.

    Of a round top, whatever its width, the band below the maximum holds 1/sqrt(3) of the samples that one three
    times as deep holds; of a cut one nearly all. Neither can be told where the signal is not well above its noise.
    """
    top = float(above.max())
    if top <= 8 * half:
        return 0
    inside, deeper = (int(np.count_nonzero(above > top - bands * half)) for bands in (2, 6))
    flat = inside >= FLAT_SHARE * deeper and inside >= deeper / np.sqrt(3) + FLAT_SAMPLES
    return inside if flat else 0


def _finest_step(above: NDArray[np.float64]) -> float:
    """Smallest step between two values: that of the converter; at least that of four written digits."""
    top = float(above.max())
    for part in (above[:FEW], above):
        step = float(np.min(np.diff(np.unique(part)), initial=top))
        if step <= DIGITS * top:
            break
    return max(step, DIGITS * top)


def _at_a_rail(above: NDArray[np.float64], step: float) -> int:
    """Samples at the maximum where it stands three times in a row; 0 where it does so because the steps are coarse.

    The three steps below the one that holds a round top together hold at least as many samples as that one.
    """
    equal = above == above.max()
    in_a_row = np.convolve(equal, np.ones(RAIL_SAMPLES), "valid").max() >= RAIL_SAMPLES
    count = int(np.count_nonzero(equal))
    near = int(np.count_nonzero(above > above.max() - 3.5 * step))
    return count if in_a_row and near <= 1.5 * count else 0
