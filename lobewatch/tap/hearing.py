"""What an accelerometer alone can hear of a machine, said before it is tapped without a force sensor."""

from __future__ import annotations

import math

import numpy as np

from acquisition import DataError, Hit
from dsm import natural_frequencies, rounded
from lobewatch.machine import Machine
from lobewatch.measuring.decays import HIGHEST
from lobewatch.tap.state import Check

HITS = 10
"""Hits that the error is told of."""
GOOD_ERROR = 1e-3
"""Standard error of f_n, relative, that such a test should reach: a third of its usual scatter."""
OF_THE_FIT = 2.0
"""Error of our fit, which leaves residual terms open, over the least that is possible: 1.3 to 2.2 in simulations."""
DAMPING = 0.03
"""Damping ratio that is taken for it where there is no model."""


def hearing_check(baseline: Hit, machine: Machine, tool: str) -> Check:
    """Band and noise of the sensor, against the mode that is followed where the model or [mode] band_hz tells it.

    baseline: a record at rest.
    """
    rate, band = baseline.sample_rate, machine.tap.sensor_band_hz or math.inf
    highest, noise = min(HIGHEST * rate, band), float(np.std(baseline.acceleration))
    heard = f"modes up to {highest:.0f} Hz are heard, noise {rounded(noise, digits=2)} m/s^2 rms"
    frequency, where = _expected(machine, tool)
    if frequency is None:
        return Check("band", True, f"{heard}; whether the mode of this machine lies there nobody says", tells=True)
    if frequency > highest:
        cure = "its decay is not seen; take a faster sensor, or a higher sample rate"
        return Check("band", False, f"{heard}; {frequency:.0f} Hz, {where}, lies beyond: {cure}")
    least = least_ringing(frequency, _damping(machine), noise / math.sqrt(min(rate / 2, band)))
    error = f"{HITS} hits that ring at {rounded(least, digits=2)} m/s^2 tell it to {100 * GOOD_ERROR:g} %"
    return Check("band", True, f"{heard}; {frequency:.0f} Hz, {where}: {error}", tells=True)


def least_ringing(frequency: float, damping_ratio: float, density: float) -> float:
    """Amplitude (m/s^2) of free decays, ten of them, whose frequency white noise leaves known to GOOD_ERROR.

    density: of the noise (m/s^2 per square root of Hz), its rms over the square root of the band that it fills.
    OF_THE_FIT times the Cramer-Rao bound of A exp(-a t) cos(w t + phase) in noise of density n:
    var(w) = 8 n^2 a^3 / A^2.
    Source: Kay, Fundamentals of Statistical Signal Processing (1993), ch. 3, for this signal.
    """
    decay = damping_ratio * 2 * math.pi * frequency
    bound = density * math.sqrt(8 * decay**3 / HITS)
    return OF_THE_FIT * bound / (GOOD_ERROR * 2 * math.pi * frequency)


def _expected(machine: Machine, tool: str) -> tuple[float | None, str]:
    """Frequency of the mode that is followed (Hz), and who says so."""
    try:
        spindle = machine.model(tool)
    except (DataError, ValueError):
        band = machine.mode.band_hz
        return (None, "") if band is None else (band[1], "the end of [mode] band_hz")
    return float(natural_frequencies(spindle, machine.mode.model_mode)[-1]), "by the model"


def _damping(machine: Machine) -> float:
    return float(machine.spindle.damping_ratio) if machine.spindle else DAMPING
