"""Where a signal was cut off by its converter or by the amplifier before it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acquisition.hit import Hit
from acquisition.pulse import baseline

RAIL_SAMPLES = 3
"""Samples at a rail of the converter, or in a row at the extreme value of one without codes."""
FLAT_SHARE = 0.7
"""Share of the samples of a band below the maximum in its uppermost third: a round top has 1/sqrt(3) = 0.58 ..."""
FLAT_SAMPLES = 2.5
"""... and a flat one this many samples more than that."""
SCALES = (1.0, 0.25, 0.0625)
"""Half widths of the uppermost third, in 3 times the noise before the hit; a saturated amplifier cuts that off too."""


@dataclass(frozen=True)
class Overload:
    """A cut-off signal."""

    level: float
    """Where it was cut off (N or m/s^2)."""
    samples: int
    """Samples there."""
    inferred: bool
    """Whether this is told by the shape of the signal, not by the codes at the rail of the converter."""


def find_overload(hit: Hit, index: int) -> Overload | None:
    """Overload of the force (index 0) or of the response (1); None where there is none.

    Certain: three codes at one rail. Inferred: the extreme value three times in a row in a recording without codes;
    or a flat top, as an amplifier makes it that saturates before the converter does, with noise on top.
    """
    signal = np.asarray((hit.force, hit.acceleration)[index])
    if hit.codes is not None and hit.channels is not None:
        for rail in hit.channels[index].rails:
            count = int(np.count_nonzero(hit.codes[index] == rail))
            if count >= RAIL_SAMPLES:
                return Overload(rail * hit.channels[index].scale, count, inferred=False)
        step = abs(hit.channels[index].scale)
    else:
        step = 0.0
    middle = float(np.median(signal))
    noise = float(np.std(baseline(signal, hit.pre_trigger or int(np.argmax(hit.force)))))
    for sign in (1, -1):
        above = sign * (signal - middle)
        count = max(_flat_top(above, 3 * noise * scale + step) for scale in SCALES) or (
            _longest_run(above == above.max()) if not step else 0
        )
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


def _longest_run(equal: NDArray[np.bool_]) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], equal.astype(np.int8), [0]))))
    return int(np.max(edges[1::2] - edges[::2], initial=0))
