"""Receptance at the tool tip over frequency, from modes or from a measured FRF."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from acquisition import Frf
from modal import Mode
from modal.arrays import Complexes, Floats

TipModes = Sequence[Mode] | None
"""Modes of the tool tip in one direction; None if it is rigid or unknown."""
TipData = Frf | Sequence[Mode]
"""Data of the tool tip in one direction: its measured FRF, or its modes."""

GRID_STEP_HALF_WIDTHS = 0.02
"""Grid spacing near a mode (half-power half-widths); relative to the distance from it further away."""
MAX_MODE_FREQUENCY_RATIO = 100
"""Highest frequency of modes over the highest natural frequency of both directions."""
MAX_TOOTH_FREQUENCY_RATIO = 2
"""Number of tooth frequencies added to it: with in-phase modes, the deciding crossing is within the first two."""
GRID_STEPS_PER_LINE = 4
"""Grid steps per line spacing of an FRF."""


@dataclass(frozen=True, eq=False)
class TipResponse:
    """Receptance of one direction, or a weighted sum of several."""

    grid: Floats
    """Frequencies that resolve the receptance, rising (Hz), shape (p,); it is unknown outside."""
    receptance: Callable[[Floats], Complexes]
    """Receptance (m/N) at any frequencies (Hz) between the ends of the grid, same shape."""
    measured: Complexes | None = None
    """Receptance on the grid (m/N), shape (p,), if it was computed before."""

    @property
    def on_grid(self) -> Complexes:
        """Receptance on the grid (m/N), shape (p,)."""
        return self.receptance(self.grid) if self.measured is None else self.measured


def check_modes(modes: Sequence[Mode], direction: str) -> None:
    """Reject an empty list of modes, and modes of no driving point."""
    if not modes:
        raise ValueError(f"{direction} has no modes. Give at least one mode, or None for a rigid direction.")
    for mode in modes:
        if not mode.is_driving_point:
            raise ValueError(
                f"the mode at {mode.frequency:g} Hz of {direction} has a negative stiffness of {mode.stiffness:g} N/m. "
                "Leave this mode out, or hit the tool at the sensor (driving point)."
            )


def tip_responses(x: TipData | None, y: TipData | None, tooth_frequency: float) -> list[tuple[int, TipResponse]]:
    """Return axis (0 for x, 1 for y) and receptance of each known direction, for tooth frequencies (Hz) up to one.

    Modes are known up to one frequency in both directions, an FRF inside its usable band, between its lines by a cubic
    spline. With two lines in zeta f_n straight lines would cut up to 3 % off the extreme real part, the spline changes
    it by up to 0.4 %. With one line in zeta f_n neither is good enough (11 % and 8 %): record longer. Raises ValueError
    if
    both are None, for no modes and for a mode of no driving point.
    """
    given = [(axis, name, tip) for axis, name, tip in ((0, "x", x), (1, "y", y)) if tip is not None]
    if not given:
        raise ValueError("x and y are both None. Give the modes or the FRF of at least one direction.")
    for _, name, tip in given:
        if not isinstance(tip, Frf):
            check_modes(tip, name)
    highest = max(_highest_frequency(tip) for _, _, tip in given) + MAX_TOOTH_FREQUENCY_RATIO * tooth_frequency
    return [(axis, _tip_response(tip, highest)) for axis, _, tip in given]


def cross_response(cross: TipData, highest: float) -> TipResponse:
    """Return the receptance from a force in x to a displacement in y.

    Modes are known up to the frequency `highest` (Hz), an FRF in its usable band. Modes have signed stiffness;
    ValueError
    for an empty list.
    """
    if not isinstance(cross, Frf) and not cross:
        raise ValueError("cross has no modes. Give at least one mode, or None if x and y are not coupled.")
    return _tip_response(cross, highest)


def common_grid(tips: Sequence[TipResponse]) -> Floats:
    """Return frequencies (Hz) that resolve all receptances within their common band; ValueError if there is none."""
    low = max(tip.grid[0] for tip in tips)
    high = min(tip.grid[-1] for tip in tips)
    if not low < high:
        ends = f"one FRF ends at {high:g} Hz, the other begins at {low:g} Hz"
        raise ValueError(f"x and y have no common band: {ends}. Give FRFs that overlap.")
    if all(np.array_equal(tip.grid, tips[0].grid) for tip in tips[1:]):
        return tips[0].grid
    grid = np.unique(np.concatenate([tip.grid for tip in tips]))
    return np.asarray(grid[(grid >= low) & (grid <= high)])


def weighted_sum(parts: Sequence[tuple[float, TipResponse]]) -> TipResponse:
    """Sum weight times receptance, known where all parts are; ValueError for bands without overlap."""
    grid = common_grid([part for _, part in parts])
    return TipResponse(grid, lambda f: _total(f, (weight * part.receptance(f) for weight, part in parts)))


def _total(frequency: Floats, receptances: Iterable[Complexes]) -> Complexes:
    return np.asarray(sum(receptances, np.zeros(np.shape(frequency), dtype=np.complex128)))


def _highest_frequency(tip: TipData) -> float:
    """Return the highest frequency (Hz) that the data of a direction covers."""
    if isinstance(tip, Frf):
        return float(tip.frequency[-1])
    return MAX_MODE_FREQUENCY_RATIO * max(mode.frequency for mode in tip)


def _tip_response(tip: TipData, highest: float) -> TipResponse:
    if isinstance(tip, Frf):
        frf = tip.in_band(tip.usable_band)
        lines = np.arange(frf.frequency.size)
        steps = np.arange(lines[-1] * GRID_STEPS_PER_LINE + 1) / GRID_STEPS_PER_LINE
        spline = scipy.interpolate.CubicSpline(frf.frequency, frf.receptance)
        return TipResponse(np.interp(steps, lines, frf.frequency), spline)
    grid = np.unique(np.concatenate([[0.0, highest], *(_grid_near_mode(mode, highest) for mode in tip)]))
    return TipResponse(grid, lambda f: _total(f, (mode.receptance(f) for mode in tip)))


def _grid_near_mode(mode: Mode, highest: float) -> Floats:
    """Return frequencies up to `highest` (Hz), dense at the mode."""
    width = mode.damping_ratio * mode.frequency
    distance = width * np.sinh(np.arange(0.0, np.arcsinh(highest / width), GRID_STEP_HALF_WIDTHS))
    around = mode.frequency + np.concatenate((-distance[::-1], distance))
    return around[(around > 0) & (around < highest)]
