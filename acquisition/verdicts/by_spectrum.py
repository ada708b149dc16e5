"""What speaks against averaging a hit in its spectrum: too little force, or an FRF far from the mean of the others."""

from __future__ import annotations

import numpy as np

from acquisition.estimation.estimate_frf import estimate_frf
from acquisition.frf import Frf
from acquisition.hit import Hit, HitFlags
from acquisition.verdicts.distance_from_mean import distance_from_mean

FAR = 0.3
"""Distance from the mean that makes a hit inconsistent: it would move a mean of ten by 3 % ..."""
FAR_NOISE_RATIO = 4.0
"""... and at least this many times what the scatter of the hits in the mean would give."""


def by_spectrum(hit: Hit, mean: Frf | None, band: tuple[float, float] | None = None) -> dict[HitFlags, str]:
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
        distance, noise = distance_from_mean(frf, mean)
        limit = max(FAR, FAR_NOISE_RATIO * noise)
        if distance > limit:
            findings[HitFlags.INCONSISTENT] = (
                f"FRF {distance:.0%} away from the mean of {mean.n_averages} hits (limit {limit:.0%})"
            )
    return findings
