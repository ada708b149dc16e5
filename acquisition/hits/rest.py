"""Whether a structure is at rest, by the rms of its response against that of the baseline."""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

REST_FACTOR = 2.0
"""The response is at rest where its rms is at most this many times that of the baseline ..."""
REST_CODES = 2.0
"""... or this many steps of the converter."""
STEADY_SHARE = 0.8
"""A response does not fall where the median rms of the second half of what was seen is this share of the first's."""


class Rest:
    """The level of rest of one response, in steps of the converter."""

    def __init__(self, rms: float, patience: int) -> None:
        """rms: of the baseline (steps); patience: after how many stretches that do not fall they are the new baseline,
        e.g. because of a machine started next door."""
        self._rms = rms
        self._seen: deque[float] = deque(maxlen=patience)

    def holds(self, response: NDArray[np.int32]) -> bool:
        """Whether the structure is at rest over these samples."""
        return bool(np.std(response) <= max(REST_FACTOR * self._rms, REST_CODES))

    def wait(self, response: NDArray[np.int32]) -> bool:
        """The same, for the next of successive stretches that rest is waited for in."""
        self._seen.append(float(np.std(response)))
        if len(self._seen) == self._seen.maxlen:
            half = len(self._seen) // 2
            first, second = (np.median(list(self._seen)[part]) for part in (slice(half), slice(half, None)))
            if second >= STEADY_SHARE * first:
                self._rms = max(self._rms, float(second))
        if not self.holds(response):
            return False
        self._seen.clear()
        return True
