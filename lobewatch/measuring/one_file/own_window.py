"""An exponential window of our own over hits that ring on when their record ends, and modes without it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from acquisition import Frf, Hit, Remark, estimate_frf, exponential_window, time_after_hit, windowed_receptance
from modal import Mode, fit_modes, remove_window, with_windowed_noise

LEFT = 0.005
"""Share of the ringing that the window lets through at the end of the record."""
MOST_LEFT = 0.005
"""Share of the decay of a mode at the end of the record from which it is taken from the windowed hits."""


def under_own_window(hits: Sequence[Hit]) -> tuple[Frf, tuple[Hit, ...], float]:
    """FRF of hits under a window that lets next to nothing of their ringing through, the hits, its time constant (s).

    What is left when the record ends stands in the FRF as if it had been cut off: K is off by about that share.
    """
    tau = min(time_after_hit(hit) for hit in hits) / -float(np.log(LEFT))
    windowed = tuple(exponential_window(hit, tau) for hit in hits)
    return windowed_receptance(estimate_frf(windowed), tau), windowed, tau


def windowed_here(about: str, time_constant: float, cure: str) -> Remark:
    """What was done to a mode, or to all (about nothing)."""
    text = f"rings on when the record ends: fitted under an exponential window of {time_constant:.3g} s, corrected"
    return Remark("windowed-here", about, text if about else f"every hit {text}", cure)


def without_own_window(modes: Sequence[Mode], time_constant: float) -> Iterator[Mode]:
    """Modes without that window; one that decays no faster than it is no mode."""
    for mode in modes:
        if 2 * np.pi * mode.damping_ratio * mode.frequency > 1 / time_constant:
            wider = with_windowed_noise(mode, time_constant, -time_constant * float(np.log(LEFT)))
            yield remove_window(wider, time_constant)


def ringing_modes_windowed(
    modes: Sequence[Mode], hits: Sequence[Hit], band: tuple[float, float] | None
) -> tuple[tuple[Mode, ...], tuple[Remark, ...]]:
    """Modes, those that still ring when the record ends taken from the hits under a window, and a remark on each."""
    if not hits or not any(_rings(mode) for mode in modes):
        return tuple(modes), ()
    frf, windowed, tau = under_own_window(hits)
    found = list(without_own_window(fit_modes(frf, band, windowed), tau))
    kept, remarks = list[Mode](), list[Remark]()
    for mode in modes:
        same = _same(mode, found) if _rings(mode) else None
        kept.append(mode if same is None else same)
        if same is not None:
            remarks.append(windowed_here(f"{same.frequency:.0f} Hz", tau, "a longer record needs none"))
    return tuple(kept), tuple(remarks)


def _rings(mode: Mode) -> bool:
    return mode.left_ringing is not None and mode.left_ringing > MOST_LEFT


def _same(mode: Mode, found: Sequence[Mode]) -> Mode | None:
    """The mode within a half-power half-width."""
    near = [other for other in found if abs(other.frequency - mode.frequency) < mode.damping_ratio * mode.frequency]
    return min(near, key=lambda other: abs(other.frequency - mode.frequency), default=None)
