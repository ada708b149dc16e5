"""How fast the spindle turns where a tachometer says it too: the lines must not contradict, and may be silent."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lobewatch.cuts.listening.fold_frequency import fold_frequency
from lobewatch.cuts.listening.lattice import SpindleSpeed, refine_speed
from lobewatch.cuts.listening.plain_comb import LOUDEST
from lobewatch.cuts.listening.sorted_lines import WIDE, lines_of_cut
from lobewatch.cuts.listening.spectrum import Spectrum
from lobewatch.cuts.listening.true_speed import COMB_AROUND, LEAST_AGREEING, speed_of_spectra

AGREES = 2e-3
"""Relative difference up to which a tachometer and the lines say one speed: a column may be rounded; chosen."""
ERROR = 5e-5
"""Relative standard error of a tachometer: a sample at each end of a second or two; chosen."""
PULSES = 0.02
"""Relative distance from a whole number within which a tachometer over the speed that was set, or the inverse, speaks
of pulses that were counted wrong; chosen."""


def measured_speed(
    spectra: Sequence[Spectrum], air: Sequence[Spectrum], teeth: int, commanded: float, measured: float
) -> tuple[SpindleSpeed | None, float]:
    """Turns a second (Hz) by lines near those of a tachometer, and those that contradict it; NaN: none do.

    commanded: as it was set, measured: by the tachometer (Hz). Where it is more than 5 % off what was set, it is
    followed if the lines fit it alone and it is no multiple of that. Where no lines say a speed near it, it is the
    speed by itself, if three of them are its multiples.
    """
    is_near = abs(measured / commanded - 1) < COMB_AROUND
    at_set = None if is_near else speed_of_spectra(spectra, air, teeth, commanded)
    if at_set is not None:
        return None, at_set.frequency
    heard = speed_of_spectra(spectra, air, teeth, measured)
    if heard is not None and abs(heard.frequency / measured - 1) > AGREES:
        return None, heard.frequency
    if not is_near and (heard is None or is_multiple(measured / commanded)):
        return None, commanded
    return heard or _by_itself(spectra, air, measured), np.nan


def is_multiple(ratio: float) -> bool:
    """Whether a tachometer over the speed that was set is a whole number above 1, or one over it."""
    whole = max(ratio, 1 / ratio)
    return round(whole) > 1 and abs(whole / round(whole) - 1) < PULSES


def _by_itself(spectra: Sequence[Spectrum], air: Sequence[Spectrum], measured: float) -> SpindleSpeed | None:
    """The speed of the tachometer, of which the lines make none; None where hardly one is a multiple of it."""
    lines, bin_ = lines_of_cut(spectra, air), spectra[0].bin
    own = fold_frequency(lines.frequency, measured) < WIDE * bin_
    if np.count_nonzero(own) < LEAST_AGREEING:
        return None
    beside = refine_speed(measured, lines.loudest(LOUDEST), bin_)
    return SpindleSpeed(measured, ERROR * measured, beside.share, int(np.count_nonzero(own)), beside.misfit)
