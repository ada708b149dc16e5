"""Peaks of an FRF where no mode is fitted, because the hammer hardly reached that far."""

from __future__ import annotations

from acquisition import Frf
from modal.bands.find_resonances import FEWEST_LINES, find_resonances


def peaks_beyond(frf: Frf) -> list[float]:
    """Frequencies of the resonances above the usable band (Hz); none where it is not known, or no line lies there.

    >>> frf = synthesize([Mode(500.0, 0.02, 2e7), Mode(1800.0, 0.02, 2e7)], np.arange(1.0, 2001.0))
    >>> from dataclasses import replace
    >>> [round(f) for f in peaks_beyond(replace(frf, usable_band=(1.0, 1500.0)))]  # Hz: the hammer did not reach it
    [1800]
    """
    if frf.usable_band is None:
        return []
    end = frf.usable_band[1]
    if (frf.frequency > end).sum() < FEWEST_LINES:
        return []
    above = frf.in_band((end, float(frf.frequency[-1])))
    try:
        return [peak.frequency for peak in find_resonances(above)]
    except ValueError:
        return []
