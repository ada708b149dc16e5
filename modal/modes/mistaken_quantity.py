"""Tell from the modes of an FRF whether its values are another quantity than stated."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acquisition.frf import FrfQuantity
from modal.modes.mode import Mode

_ORDER: dict[FrfQuantity, int] = {"receptance": 0, "mobility": 1, "accelerance": 2}
"""Number of time derivatives of the displacement in each form of an FRF."""
MODAL_MASS_LIMITS = 3e-4, 1e5
"""Limits of the modal mass K/w^2 of a tapped structure (kg), from a thin end mill to a large machine; chosen.

Each time derivative too many or too few changes it by w, hundreds to ten thousands. Measured structures have
0.007 to 3e4 kg.
"""
MIN_QUARTER_TURN_DEG = 65.0
"""Phase that three of four modal constants exceed if they are imaginary instead of real (degrees); chosen."""


def median_modal_mass(modes: Sequence[Mode]) -> float:
    """Return the median modal mass |K|/w^2 of at least one mode (kg).

    Parameters
    ----------
    modes : sequence of Mode
        Modes with stiffness.

    Returns
    -------
    float
        Median modal mass (kg).

    Examples
    --------
    >>> round(median_modal_mass([Mode(500.0, 0.02, 2e7)]), 2)
    2.03
    """
    return float(np.median([abs(mode.stiffness) / (2 * np.pi * mode.frequency) ** 2 for mode in modes]))


def is_plausible_mass(mass: float) -> bool:
    """Return whether a structure can have this modal mass (kg).

    Parameters
    ----------
    mass : float
        Modal mass (kg).
    """
    low, high = MODAL_MASS_LIMITS
    return low <= mass <= high


def find_true_quantity(modes: Sequence[Mode], stated: FrfQuantity) -> FrfQuantity | None:
    """Return the quantity that the values of an FRF must be, if it is not the stated one.

    A modal constant is nearly real in receptance. Each time derivative too many multiplies it by i w: one turns all
    constants by a quarter, two make them negative with an impossible modal mass. So the phases decide between odd and
    even, and the modal mass between the others.

    Parameters
    ----------
    modes : sequence of Mode
        Modes of one FRF, with stiffness, that are no noise.
    stated : FrfQuantity
        Quantity by which the receptance was computed.

    Returns
    -------
    FrfQuantity or None
        Other quantity; None if the stated one is possible, or none is.

    References
    ----------
    Ewins, Modal Testing, ch. 2 (alternative forms of the FRF).

    Examples
    --------
    >>> accelerance = [Mode(f, 0.02, -2e7 / (2 * np.pi * f) ** 2) for f in (500.0, 900.0)]  # read as receptance
    >>> find_true_quantity(accelerance, "receptance"), find_true_quantity([Mode(500.0, 0.02, 2e7)], "receptance")
    ('accelerance', None)
    """
    is_turned = float(np.quantile([abs(mode.phase_deg) for mode in modes], 0.25)) > MIN_QUARTER_TURN_DEG
    if not is_turned and (is_plausible_mass(median_modal_mass(modes)) or all(mode.stiffness > 0 for mode in modes)):
        return None
    others = [quantity for quantity in _ORDER if (_ORDER[quantity] - _ORDER[stated]) % 2 == is_turned]
    masses = {quantity: _mass_in(modes, stated, quantity) for quantity in others}
    possible = [quantity for quantity, mass in masses.items() if is_turned or is_plausible_mass(mass)]
    return min(possible, key=lambda quantity: abs(np.log10(masses[quantity])), default=None)


def _mass_in(modes: Sequence[Mode], stated: FrfQuantity, true: FrfQuantity) -> float:
    """Return the median modal mass if the values of an FRF are another quantity than stated (kg)."""
    step = _ORDER[true] - _ORDER[stated]
    return median_modal_mass([replace(m, stiffness=m.stiffness * (2 * np.pi * m.frequency) ** step) for m in modes])
