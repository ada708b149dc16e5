"""Find the lower half of a two-sided FRF."""

import numpy as np

from acquisition.arrays import Complexes, Floats, Indices

MAX_MIRROR_ERROR = 1e-3
"""Largest difference of two mirrored values, as a share of the value; chosen above the rounding of four digits."""
MAX_ROUNDING = 1e-6
"""Further difference, as a share of the largest value, for numbers printed with equal decimals; chosen."""
MIN_MIRRORED_LINES = 8
"""Fewest pairs of mirrored lines with a clear imaginary part; chosen."""


def find_lower_half(frequency: Floats, values: Complexes) -> Indices:
    """Find the lines of an FRF without its mirror image.

    The transform of real signals is two-sided: H[N - k] is the complex conjugate of H[k]. Negative frequencies are the
    mirror image, too. The imaginary part decides, because a real part may be alike on both sides of any line.

    Parameters
    ----------
    frequency
        Frequency lines (Hz), shape (n,).
    values
        FRF in the form of the file, shape (n,).

    Returns
    -------
    ndarray of int
        Indices of the lines to use; all lines if the FRF is not two-sided.

    References
    ----------
    Oppenheim & Schafer, Discrete-Time Signal Processing, symmetry properties of the DFT.

    Examples
    --------
    >>> record = np.exp(-np.arange(64) / 9.0) * np.sin(np.arange(64.0))
    >>> find_lower_half(np.arange(64.0), np.fft.fft(record))[[0, -1]]  # up to half the sample rate
    array([ 0, 32])
    """
    lines = np.arange(frequency.size)
    if np.any(frequency < 0):
        return lines[frequency >= 0]
    steps = np.diff(frequency)
    if steps.size == 0 or np.ptp(steps) > 1e-3 * abs(steps[0]) or not np.all(np.isfinite(values[1:])):
        return lines
    centre = _find_mirror_sum(values)
    return lines if centre is None else lines[: centre // 2 + 1]


def _find_mirror_sum(values: Complexes) -> int | None:
    """Return the sum of the indices of mirrored lines, or None without a mirror image."""
    n, finite = values.size, np.nan_to_num(values)
    products = np.fft.irfft(np.fft.rfft(finite.imag, 2 * n) ** 2, 2 * n)  # sum of Im H[k] Im H[total - k] by total
    total = int(np.argmin(products))
    pairs = np.arange(max(0, total - n + 1), (total + 1) // 2)
    if products[total] >= 0:
        return None
    one, other = finite[pairs], finite[total - pairs]
    allowed = MAX_MIRROR_ERROR * np.abs(one) + MAX_ROUNDING * np.max(np.abs(finite))
    is_clear = np.abs(one.imag) > allowed
    is_mirrored = np.all(np.abs(one - other.conj()) <= allowed) and np.sum(is_clear) >= MIN_MIRRORED_LINES
    return total if is_mirrored else None
