"""The mode that is followed over the life of a machine."""

from __future__ import annotations

from collections.abc import Sequence

from modal.modes.mode import Mode


def predominant(modes: Sequence[Mode], band: tuple[float, float] | None = None) -> Mode | None:
    """The driving-point mode inside band (Hz, ends included) with the largest peak of -Im of receptance, 1/(2 zeta K).

    None where there is none. Source: Gaber & Hashemi (2015), "the most predominant mode".

    >>> modes = [Mode(500.0, 0.02, 2e7), Mode(900.0, 0.03, 1e7)]
    >>> predominant(modes).frequency  # Hz: 1 / (2 zeta K) is 1.25 um/N there, and 1.67 at 900 Hz
    900.0
    >>> predominant(modes, band=(0.0, 800.0)).frequency
    500.0
    """
    low, high = band or (0.0, float("inf"))
    if not low < high:
        raise ValueError(f"band {low:g}..{high:g} Hz is empty; give the lower frequency first")
    able = [mode for mode in modes if mode.is_driving_point and low <= mode.frequency <= high]
    return max(able, key=lambda mode: mode.peak, default=None)
