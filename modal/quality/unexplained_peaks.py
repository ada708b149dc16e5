"""Find measured peaks that the modes used for lobes do not explain."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from acquisition import Frf
from modal.bands.find_resonances import find_resonances
from modal.bands.frf_lines import usable_lines
from modal.modes.mode import Mode, synthesize_frf

PEAK_HALF_WIDTHS = 2.5
"""Half-widths around a peak in which the most negative real part is searched; a single mode has it at one."""
MIN_LIMITING_SHARE = 0.2
"""Most negative real part near a peak over that of all lines from which it may limit a cut; chosen."""
UNEXPLAINED_SHARE = 0.25
"""Share of the most negative real part that the modes may miss; chosen."""


class UnexplainedPeak(NamedTuple):
    """Measured peak that is worse than the modes explain."""

    frequency: float
    """Frequency of the peak (Hz)."""
    measured: float
    """Most negative real part of the measured receptance near it (m/N)."""
    explained: float
    """Most negative real part there of the modes, within their uncertainty (m/N)."""


def find_unexplained_peaks(frf: Frf, modes: Sequence[Mode]) -> tuple[UnexplainedPeak, ...]:
    """Find the measured peaks whose most negative real part the modes do not explain.

    The limiting depth of a cut is inversely proportional to the most negative real part of the receptance.

    Parameters
    ----------
    frf : Frf
        Measured FRF.
    modes : sequence of Mode
        Modes used for lobes, with stiffness; may be empty.

    Returns
    -------
    tuple of UnexplainedPeak
        Peaks by rising frequency; empty if the modes cover the measurement.

    References
    ----------
    Altintas & Budak (1995), CIRP Annals 44, 357 (limit and real part).

    Examples
    --------
    >>> modes = [Mode(500.0, 0.02, 2e7), Mode(900.0, 0.03, 5e7)]
    >>> frf = synthesize_frf(modes, np.arange(1.0, 1501.0))
    >>> find_unexplained_peaks(frf, modes)
    ()
    >>> [round(peak.frequency) for peak in find_unexplained_peaks(frf, modes[:1])]  # Hz
    [900]
    """
    lines = usable_lines(frf, None)
    f, measured = lines.frequency, lines.receptance.real
    explained = synthesize_frf(modes, f).receptance.real
    lowest = min((mode.frequency for mode in modes), default=0.0) / 2
    found = list[UnexplainedPeak]()
    for peak in find_resonances(lines):
        near = (np.abs(f - peak.frequency) <= PEAK_HALF_WIDTHS * peak.half_width) & (f >= lowest)
        if np.any(near):
            found.append(UnexplainedPeak(peak.frequency, float(measured[near].min()), float(explained[near].min())))
    deepest = min((peak.measured for peak in found), default=0.0)
    return tuple(
        peak
        for peak in found
        if peak.measured < MIN_LIMITING_SHARE * deepest and peak.explained > (1 - UNEXPLAINED_SHARE) * peak.measured
    )
