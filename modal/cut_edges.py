"""Where the frequency axis ends on a peak."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition import Frf
from modal.bands.find_resonances import NOISE_MULTIPLE, mobility_noise
from modal.bands.usable_lines import usable_lines
from modal.modes.mode import Mode

RISE = 10 ** (1 / 20)
"""A line inside that is this many times as high as the edge is a peak of its own."""
REAL_FALL = 0.7
"""Where |mobility| of a mode has fallen to 1/sqrt(2) its real part, as |mobility|^2, is halved; before an antiresonance
it stays."""


def cut_edges(frf: Frf, modes: Sequence[Mode], band: tuple[float, float] | None = None) -> list[float]:
    """First and last line (Hz) between band[0] and band[1] where a peak may be cut that none of the modes accounts for.

    There |mobility| falls from the edge inwards below 1/sqrt(2) of its value and is more real than imaginary, as it
    is between the half-power points of a mode; on the line of a mass or a spring it is imaginary. Its real part
    falls with it, which it does not between a peak and an antiresonance. Raises ValueError as `usable_lines`.

    >>> frf = synthesize([Mode(500.0, 0.02, 2e7)], np.arange(505.0, 1001.0))  # begins on the flank of a peak
    >>> cut_edges(frf, [])
    [505.0]
    """
    lines = usable_lines(frf, band)
    f, mobility = lines.frequency, lines.mobility
    noise = mobility_noise(lines)
    edges = [float(f[end]) for end, step in ((0, 1), (-1, -1)) if _falls(mobility[::step], NOISE_MULTIPLE * noise[end])]
    return [
        edge
        for edge in edges
        if all(abs(mode.frequency - edge) > mode.damping_ratio * mode.frequency for mode in modes)
    ]


def _falls(mobility: NDArray[np.complex128], least: float) -> bool:
    """Whether it falls from its first line like a peak, and is higher there than the least."""
    size = np.abs(mobility)
    low = np.flatnonzero(size < size[0] / np.sqrt(2))
    if not low.size or low[0] < 2 or size[0] < least or np.max(size[: low[0]]) > RISE * size[0]:
        return False
    is_real = abs(mobility[0].real) > abs(mobility[0].imag)
    return bool(is_real and mobility[low[0]].real / mobility[0].real < REAL_FALL)
