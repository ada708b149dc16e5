"""Measured natural frequencies of one or several spindles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dsm.matrix.frequency_axis import frequency_axis

_Float = NDArray[np.float64]


class Measured(NamedTuple):
    """What was measured."""

    mode: NDArray[np.int_]
    """Numbers of the modes, shape (n,); 1 is the lowest."""
    frequency: _Float
    """Frequencies (Hz), shape (n,)."""
    std: _Float | None
    """Standard errors (Hz), shape (n,); None where not given."""
    shaft: NDArray[np.int_]
    """Number of the spindle that each belongs to, shape (n,); 0 is the first."""

    @property
    def scale(self) -> _Float:
        """What residuals are divided by: standard errors (Hz); where there are none, the frequencies."""
        return self.frequency if self.std is None else self.std


def check_measured(
    spindles: int,
    frequency: ArrayLike,
    frequency_std: ArrayLike | None,
    mode: Sequence[int] | None,
    shaft: Sequence[int] | None,
) -> Measured:
    """What was measured of so many spindles, as fit_stiffness takes it; ValueError for what cannot be."""
    f = frequency_axis(frequency)
    if np.any(f == 0):
        raise ValueError("frequency=0 Hz is not > 0")
    std = None if frequency_std is None else np.atleast_1d(np.asarray(frequency_std, dtype=np.float64))
    if std is not None and (std.shape != f.shape or not np.all(np.isfinite(std) & (std > 0))):
        raise ValueError(
            f"frequency_std={frequency_std!r} is not one finite number > 0 (Hz) for each of {f.size} modes"
        )
    where = np.zeros(f.size, dtype=np.int_) if shaft is None else np.atleast_1d(np.asarray(shaft))
    if where.shape != f.shape or where.dtype.kind not in "iu" or {*where.tolist()} != {*range(spindles)}:
        raise ValueError(
            f"shaft={shaft} does not say for each of {f.size} modes on which of {spindles} spindles it was measured, "
            f"0 to {spindles - 1}, each at least once"
        )
    numbers = np.arange(1, f.size + 1) if mode is None else np.atleast_1d(np.asarray(mode))
    whole = numbers.shape == f.shape and numbers.dtype.kind in "iu"
    for number in range(spindles):
        _check_modes(f[where == number], numbers[where == number] if whole else numbers, mode)
    return Measured(numbers, f, std, where)


def _check_modes(f: _Float, numbers: NDArray[np.int_], mode: Sequence[int] | None) -> None:
    """Of one spindle."""
    whole = numbers.shape == f.shape and numbers.dtype.kind in "iu"
    if not whole or np.any(numbers < 1) or np.unique(numbers).size < f.size:
        raise ValueError(f"mode={mode} is not one number from 1 (the lowest) for each of {f.size} modes, all different")
    order = np.argsort(numbers)
    if np.any(np.diff(f[order]) <= 0):
        raise ValueError(
            f"frequency={f[order].tolist()} Hz does not rise with the number of the mode, {numbers[order]}"
        )
