"""The lines of an FRF that modes are looked for in."""

from __future__ import annotations

from acquisition import Frf


def usable_lines(frf: Frf, band: tuple[float, float] | None) -> Frf:
    """The lines above 0 Hz that lie in the usable band, where the FRF has one, and in band (Hz).

    Raises ValueError where fewer than two are left.
    """
    above_zero = frf.in_band((frf.frequency[1], frf.frequency[-1])) if frf.frequency[0] == 0 else frf
    return above_zero.in_band(frf.usable_band).in_band(band)
