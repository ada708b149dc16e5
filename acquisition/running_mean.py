"""The mean of the good hits while they come: each can be taken back, and one sees whether more of them change it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.estimate_frf import Spectra, cross_spectra, usable_band
from acquisition.frf import Frf, from_accelerance
from acquisition.hit import Hit

SETTLED_HITS = 4
"""Under so many hits a mean is not called settled."""
SETTLED_ERROR = 0.005
"""Standard error of |H| near the highest peak below which the mean has settled (-)."""
PEAK_SHARE = 0.5
"""Near the peak is where |accelerance| is at least this share of its largest value in the usable band."""


class RunningMean:
    """H1 of hits of one set-up from their spectra, which are kept one by one."""

    def __init__(self) -> None:
        """No hit yet."""
        self._spectra: list[tuple[Hit, Spectra]] = []
        self._frf: Frf | None = None

    @property
    def hits(self) -> tuple[Hit, ...]:
        """The hits in it, in the order in which they came."""
        return tuple(hit for hit, _ in self._spectra)

    @property
    def frf(self) -> Frf | None:
        """H1 with coherence and usable band, as estimate_frf gives it for the same hits; None where there is none."""
        if self._frf is None and self._spectra:
            self._frf = _h1(self.hits, [spectra for _, spectra in self._spectra])
        return self._frf

    @property
    def change(self) -> float | None:
        """By which share the last hit moved the mean; None under 2 hits.

        rms of the difference of the accelerance with and without it over rms of the accelerance, in the usable band.
        """
        if self.frf is None or len(self._spectra) < 2:
            return None
        inside = _usable(self.frf)
        now, before = self.frf.accelerance[inside], self.without(self.hits[-1]).accelerance[inside]
        return float(np.linalg.norm(now - before) / np.linalg.norm(now))

    @property
    def settled(self) -> bool:
        """Whether more hits would hardly change the peak: at least SETTLED_HITS of them, and the random error of |H|,
        sqrt((1 - g2) / (2 n g2)), as rms over the lines near the highest peak, is below SETTLED_ERROR."""
        return len(self._spectra) >= SETTLED_HITS and self.peak_error < SETTLED_ERROR

    @property
    def peak_error(self) -> float:
        """Standard error of |H| near the highest peak (-); inf under 3 hits, where coherence says nothing yet."""
        frf = self.frf
        if frf is None or frf.random_error is None or len(self._spectra) < 3:
            return float("inf")
        size = np.abs(frf.accelerance) * _usable(frf)
        near = size >= PEAK_SHARE * np.max(size)
        return float(np.sqrt(np.mean(frf.random_error[near] ** 2)))

    def add(self, hit: Hit) -> None:
        """Take a good hit in; ValueError where it has no pulse, or another length or rate than those before."""
        if self._spectra and (hit.force.size, hit.sample_rate) != (self.hits[0].force.size, self.hits[0].sample_rate):
            raise ValueError(
                f"a hit of {hit.force.size} samples at {hit.sample_rate:g} Hz cannot join a mean of hits of "
                f"{self.hits[0].force.size} samples at {self.hits[0].sample_rate:g} Hz; begin a new test"
            )
        self._spectra.append((hit, cross_spectra([hit])))
        self._frf = None

    def without(self, hit: Hit) -> Frf:
        """H1 of the other hits; ValueError where this one is not in the mean, or alone in it."""
        others = self._others(hit)
        if not others:
            raise ValueError("this hit is the only one in the mean; there is no mean of the others")
        return _h1([other for other, _ in others], [spectra for _, spectra in others])

    def remove(self, hit: Hit) -> None:
        """Take a hit back; ValueError where it is not in the mean."""
        self._spectra, self._frf = self._others(hit), None

    def _others(self, hit: Hit) -> list[tuple[Hit, Spectra]]:
        kept = [entry for entry in self._spectra if entry[0] is not hit]
        if len(kept) == len(self._spectra):
            raise ValueError("this hit is not in the mean; only hits that were added can be taken back")
        return kept


def _h1(hits: Sequence[Hit], spectra: Sequence[Spectra]) -> Frf:
    s_ff, s_xx, s_fx = (_mean([one[i] for one in spectra]) for i in range(3))
    frequency = np.fft.rfftfreq(hits[0].force.size, 1 / hits[0].sample_rate)
    coherence = np.minimum(np.abs(s_fx) ** 2 / (s_ff * s_xx), 1.0) if len(hits) > 1 else None
    return from_accelerance(frequency, s_fx / s_ff, coherence, len(hits), usable_band(frequency, s_ff.real))


def _mean(arrays: Sequence[NDArray[Any]]) -> NDArray[Any]:
    return np.asarray(np.mean(arrays, axis=0))


def _usable(frf: Frf) -> NDArray[np.bool_]:
    low, high = frf.usable_band or (0.0, np.inf)
    return np.asarray((frf.frequency >= low) & (frf.frequency <= high))
