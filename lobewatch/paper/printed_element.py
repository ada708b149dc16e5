"""The paper's spinning element A B^-1, equations (13) to (25), in the arithmetic of a computer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsm import SpinningSegment

_Float = NDArray[np.float64]


def printed_element(
    segment: SpinningSegment, frequency: float, speed_rpm: float, coupling: float = 1.0, one_sign: bool = True
) -> _Float:
    """Stiffness of one element at a frequency (Hz) seen from the shaft, shape (8, 8), laid out as `spinning_element`.

    The eight solutions exp(r z) of (13), r by (14) to (16), each with its ratio of v to u: their end forces are A,
    their end displacements B. coupling: sign of 2 m Omega w in (5), + as printed, - for u = U cos, v = V sin.
    one_sign: end forces have one sign at both ends, as (23) is printed; right is the opposite one at z = 0. Not finite
    where B cannot be inverted: at speed 0, at frequency 0, and where the two are equal.
    """
    w, spin = 2 * np.pi * frequency, speed_rpm * np.pi / 30
    length, exx, eyy = segment.length, segment.rigidity_xx, segment.rigidity_yy
    same, other = segment.mass_per_length * (w**2 + spin**2), 2 * segment.mass_per_length * w * spin * coupling
    q = fourth_powers(segment, frequency, speed_rpm)
    with np.errstate(all="ignore"):
        root = np.repeat(q + 0j, 4) ** 0.25 * np.tile(1j ** np.arange(4), 2)
        shape = np.array([np.ones(8), -(eyy * np.repeat(q, 4) - same) / other])
        displaced, forced = [], []
        for end, outward in ((0.0, 1.0 if one_sign else -1.0), (length, 1.0)):
            wave = shape * np.exp(root * end)
            displaced += [wave, root * wave]
            rigid = np.array([[eyy], [exx]])
            forced += [-outward * rigid * root**3 * wave, outward * rigid * root**2 * wave]
        try:
            return np.asarray(np.real(np.vstack(forced) @ np.linalg.inv(np.vstack(displaced))))
        except np.linalg.LinAlgError:
            return np.full((8, 8), np.nan)


def fourth_powers(segment: SpinningSegment, frequency: float, speed_rpm: float) -> _Float:
    """The two fourth powers of the roots of (13) by (14) to (16) (m^-4), shape (2,)."""
    w, spin = 2 * np.pi * frequency, speed_rpm * np.pi / 30
    exx, eyy, mass = segment.rigidity_xx, segment.rigidity_yy, segment.mass_per_length
    same, other = mass * (w**2 + spin**2), 2 * mass * w * spin
    mean = same * (exx + eyy) / 2
    half = np.sqrt(max(mean**2 - exx * eyy * (same**2 - other**2), 0.0))  # not negative but for rounding
    return np.array([mean + half, mean - half]) / (exx * eyy)
