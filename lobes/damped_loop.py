"""Stability limits of the mean force with process damping."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lobes.cut import Cut
from lobes.tooth_force import mean_regeneration
from modal.arrays import Complexes, Floats

REFINEMENT_STEPS = 4
"""Steps of the false position that refine a crossing."""
REFINED_STEPS = 6
"""Number of steps of the lowest crossings that are refined, as crossings of many lobes are nearly equal; chosen."""

Receptances = Callable[[Floats], tuple[Complexes, Complexes, Complexes]]
"""Function from frequencies (r, k) in Hz to the receptances xx, yy and xy (m/N), each of shape (r, k)."""


class _LoopParts(NamedTuple):
    """Parts of the loop matrix that do not depend on the speed, at some frequencies, shape (2, 2, r, k) each."""

    cutting: Complexes
    """H0 G (1/m)."""
    damping: Complexes
    """C / D N0 (G - J / (i w)) (1/m)."""


class _Steps(NamedTuple):
    """Steps between two frequencies (Hz) in which a loop (1/m) becomes real, shape (r,) or (r, s) each."""

    low: Floats
    high: Floats
    at_low: Complexes
    at_high: Complexes

    def interpolate(self) -> tuple[Floats, Complexes]:
        """Return frequency and loop where the loop is real on a line."""
        rise = self.at_high.imag - self.at_low.imag
        share = -self.at_low.imag / np.where(rise == 0, 1.0, rise)
        return self.low + share * (self.high - self.low), self.at_low + share * (self.at_high - self.at_low)

    def narrow(self, frequency: Floats, loop: Complexes) -> "_Steps":
        """Return the parts on one side of frequencies inside."""
        is_low = (loop.imag < 0) == (self.at_low.imag < 0)
        low, high = np.where(is_low, frequency, self.low), np.where(is_low, self.high, frequency)
        return _Steps(low, high, np.where(is_low, loop, self.at_low), np.where(is_low, self.at_high, loop))


@dataclass(frozen=True, eq=False)
class DampedLoop:
    """Chatter loops of r systems whose flanks damp the tip.

    With the mean force matrix H0, the mean N0 of n n' and f_c / f_t waves in the tooth period of N teeth, the loop is

        L = eigenvalue of ((1 - exp(-i w tau)) H0 + 2 i N (f_c / f_t) (C / D) N0) G,     b = -1 / L,

    as i w C / V = 2 i N (f_c / f_t) C / D. Truncated complex modes jump with a force by J: process damping resists
    their free motion, N0 (G - J / (i w)), as in `lobes.floquet.damped_response`. The lowest b counts for which L is
    real and negative. For uneven teeth the regeneration is the mean over the delays.
    Sources: Altintas & Budak, CIRP Annals 44 (1995) 357-362; Tyler & Schmitz, J. Manuf. Process. 15 (2013) 69-76, who
    find the same b by iteration.
    """

    cut: Cut
    """Teeth and pitch of all systems."""
    force: Floats
    """Mean force matrices H0 (Pa), shape (r, 2, 2)."""
    damping: Floats
    """Mean process damping matrices C / D N0 (Pa), shape (r, 2, 2)."""
    receptance: Receptances
    """Receptances of all systems."""
    jump: Floats
    """Velocity J of the tip per force at once (m/s/N), shape (r, 2, 2); 0 without complex modes."""

    def limits(self, grid: Floats, tooth_frequency: Floats) -> tuple[Floats, Floats]:
        """Return the lowest limit (m) and its frequency (Hz) at tooth frequencies (r, s) in Hz, each of shape (r, s).

        grid (r, k): rising frequencies (Hz) that resolve modes and regeneration. Inf and nan if there is no limit. One
        system may have r tooth frequencies (r, 1) with a grid (1, k).
        """
        parts = self._parts(grid)
        found = [self._lowest_steps(grid, parts, teeth[:, np.newaxis]) for teeth in tooth_frequency.T]
        steps = _Steps._make(np.concatenate(part, axis=1) for part in zip(*found, strict=True))
        repeated = np.repeat(tooth_frequency, REFINED_STEPS, axis=1)
        for _ in range(REFINEMENT_STEPS):
            frequency, near = steps.interpolate()
            half, root = self._eigenvalues(self._parts(frequency), frequency, repeated)
            is_first = np.abs(half + root - near) < np.abs(half - root - near)
            steps = steps.narrow(frequency, np.where(is_first, half + root, half - root))
        refined, loop = steps.interpolate()
        parts_at = [part.reshape(*tooth_frequency.shape, REFINED_STEPS) for part in (refined, loop.real)]
        lowest = np.argmin(parts_at[1], axis=-1)[..., np.newaxis]
        chatter, size = (np.take_along_axis(part, lowest, axis=-1)[..., 0] for part in parts_at)
        limited = size < 0
        return np.where(limited, -1 / np.where(limited, size, -1.0), np.inf), np.where(limited, chatter, np.nan)

    def _parts(self, frequency: Floats) -> _LoopParts:
        xx, yy, xy = self.receptance(frequency)
        shown = np.array([[xx, xy + 0 * xx], [xy + 0 * xx, yy]])
        jump = np.moveaxis(self.jump, 0, -1)[..., np.newaxis]
        moving = shown + 0.5j / np.pi / np.where(frequency > 0, frequency, 1.0) * jump if np.any(jump) else shown
        pairs = (self.force, shown), (self.damping, moving)
        return _LoopParts(*(np.einsum("rij,jlrk->ilrk", matrix, part) for matrix, part in pairs))

    def _eigenvalues(
        self, parts: _LoopParts, frequency: Floats, tooth_frequency: Floats
    ) -> tuple[Complexes, Complexes]:
        """Return mean and half difference of both loops (1/m), shape (r, k) each."""
        waves = frequency / tooth_frequency
        gain, rate = mean_regeneration(self.cut, waves), 2j * self.cut.teeth * waves
        (xx, xy), (yx, yy) = gain * parts.cutting + rate * parts.damping
        half = (xx + yy) / 2
        return half, np.sqrt(half**2 - (xx * yy - xy * yx))

    def _lowest_steps(self, grid: Floats, parts: _LoopParts, tooth_frequency: Floats) -> _Steps:
        """Return the steps (r, `REFINED_STEPS`) of the lowest limits at tooth frequencies (r, 1); else of zeros."""
        half, root = self._eigenvalues(parts, grid, tooth_frequency)
        root[:, 1:] *= np.cumprod(np.where(np.real(root[:, 1:] * np.conj(root[:, :-1])) < 0, -1.0, 1.0), axis=1)
        loop = np.stack((half + root, half - root), axis=1)
        row, branch, step = np.nonzero((loop.imag[..., 1:] < 0) != (loop.imag[..., :-1] < 0))
        at = np.broadcast_to(grid, half.shape)
        steps = _Steps(at[row, step], at[row, step + 1], loop[row, branch, step], loop[row, branch, step + 1])
        order = np.lexsort((steps.interpolate()[1].real, row))
        rank = np.arange(row.size) - np.searchsorted(row[order], row[order])
        few = rank < REFINED_STEPS
        lowest = np.zeros((4, len(half), REFINED_STEPS), np.complex128)
        lowest[:, row[order][few], rank[few]] = np.array(steps)[:, order[few]]
        return _Steps(lowest[0].real, lowest[1].real, lowest[2], lowest[3])
