"""The mean of the good hits while they come: each can be taken back, and one sees whether more of them change it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acquisition.estimation.estimate_frf import Spectra, cross_spectra, estimate_frf, frf_of_spectra
from acquisition.frf import Frf
from acquisition.hit import Hit

SETTLED_HITS = 4
"""Under so many hits a mean is not called settled."""
SETTLED_ERROR = 0.005
"""Standard error of |H| near the highest peak below which the mean has settled (-)."""
PEAK_SHARE = 0.5
"""Near the peak is where |accelerance| is at least this share of its largest value in the usable band."""


class RunningMean:
    """H1 of hits of one set-up from the sum of their spectra; of hits without force the hits alone.

    >>> time = np.arange(-100, 4000) / 10240.0
    >>> pulse = np.where((time >= 0) & (time <= 1e-3), np.sin(np.pi * time / 1e-3) ** 4, 0.0)
    >>> response = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7])).response(time, 1e-3)
    >>> mean, random = RunningMean(), np.random.default_rng(1)
    >>> for force in (180.0, 200.0, 220.0, 240.0, 260.0):
    ...     mean.add(Hit(force * pulse, force * response + random.normal(0.0, 2.0, time.size), 10240.0, 100))
    >>> mean.settled, f"{100 * mean.peak_error:.1f} %"
    (True, '0.5 %')
    """

    def __init__(self) -> None:
        """No hit yet."""
        self.hits: tuple[Hit, ...] = ()
        """The hits in it, in the order in which they came."""
        self.frf: Frf | None = None
        """H1 with coherence and usable band, as estimate_frf gives it for the same hits; None where there is none."""
        self._sums: Spectra | None = None
        self._before: Frf | None = None

    @property
    def change(self) -> float | None:
        """By which share the last hit moved the mean; None under 2 hits.

        rms of the difference of the accelerance with and without it over rms of the accelerance, in the usable band.
        """
        if self.frf is None or self._before is None:
            return None
        inside = _usable(self.frf)
        now, before = (frf.accelerance[inside] for frf in (self.frf, self._before))
        return float(np.linalg.norm(now - before) / np.linalg.norm(now))

    @property
    def settled(self) -> bool:
        """Whether more hits would hardly change the peak: at least SETTLED_HITS of them, and the random error of |H|,
        sqrt((1 - g2) / (2 n g2)), as rms over the lines near the highest peak, is below SETTLED_ERROR."""
        return len(self.hits) >= SETTLED_HITS and self.peak_error < SETTLED_ERROR

    @property
    def peak_error(self) -> float:
        """Standard error of |H| near the highest peak (-); inf under 3 hits, where coherence says nothing yet."""
        frf = self.frf
        if frf is None or frf.random_error is None:
            return float("inf")
        size = np.abs(frf.accelerance) * _usable(frf)
        near = size >= PEAK_SHARE * np.max(size)
        return float(np.sqrt(np.mean(frf.random_error[near] ** 2)))

    def add(self, hit: Hit) -> None:
        """Take a good hit in; ValueError where it has no pulse, or another length or rate than those before."""
        size = hit.acceleration.size
        if self.hits and (size, hit.sample_rate) != (self.hits[0].acceleration.size, self.hits[0].sample_rate):
            raise ValueError(
                f"a hit of {size} samples at {hit.sample_rate:g} Hz cannot join a mean of hits of "
                f"{self.hits[0].acceleration.size} samples at {self.hits[0].sample_rate:g} Hz; begin a new test"
            )
        if not hit.has_force:
            self.hits = (*self.hits, hit)
            return
        spectra = cross_spectra([hit])
        sums, hits = self._sums, (*self.hits, hit)
        sums = spectra if sums is None else (sums[0] + spectra[0], sums[1] + spectra[1], sums[2] + spectra[2])
        self._before, self.frf = self.frf, frf_of_spectra(sums, hits)
        self._sums, self.hits = sums, hits

    def without(self, hit: Hit) -> Frf:
        """H1 of the other hits; ValueError where this one is not in the mean, or alone in it."""
        others = self._others(hit)
        if not others:
            raise ValueError("this hit is the only one in the mean; there is no mean of the others")
        return estimate_frf(others)

    def remove(self, hit: Hit) -> None:
        """Take a hit back; ValueError where it is not in the mean."""
        kept = self._others(hit)
        self.hits, self.frf, self._sums = (), None, None
        for remaining in kept:  # anew: subtraction would leave its rounding errors
            self.add(remaining)

    def _others(self, hit: Hit) -> list[Hit]:
        kept = [counted for counted in self.hits if counted is not hit]
        if len(kept) == len(self.hits):
            raise ValueError("this hit is not in the mean; only hits that were added can be taken back")
        return kept


def _usable(frf: Frf) -> NDArray[np.bool_]:
    low, high = frf.usable_band or (0.0, np.inf)
    return np.asarray((frf.frequency >= low) & (frf.frequency <= high))
