"""What an FRF would be without the mass of the sensor."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acquisition.frf import Frf


def without_mass(frf: Frf, mass: float) -> Frf:
    """The FRF of a driving point without a mass (kg) that moves along with it; the same for none.

    The structure feels the hammer's force and -mass x acceleration of what rides on it, so that 1/H = 1/H_m + mass w^2
    with the measured receptance H_m: H = H_m / (1 + mass w^2 H_m). Of a response that is not where the hammer hits this
    does not hold. Source: Ashory (1998), Correction of mass-loading effects of transducers, IMAC 16.

    A sensor of 20 g on a mass of 2 kg:

    >>> measured = from_accelerance([100.0, 200.0], [1 / 2.02, 1 / 2.02])
    >>> round(float(1 / without_mass(measured, 0.02).accelerance[0].real), 6)  # kg
    2.0
    """
    if mass == 0:
        return frf
    loading = 1 + mass * (2 * np.pi * frf.frequency) ** 2 * frf.receptance
    return replace(frf, receptance=frf.receptance / loading, mass_removed=frf.mass_removed + mass)
