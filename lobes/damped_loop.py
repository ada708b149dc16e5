"""Stability limits of the mean force with process damping."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from lobes.cut import Cut
from lobes.tooth_force import mean_regeneration
from modal.arrays import Complexes, Floats

REFINEMENT_STEPS = 4
"""Steps of the false position that refine a crossing."""

Receptances = Callable[[Floats], tuple[Complexes, Complexes, Complexes]]
"""Function from frequencies (r, k) in Hz to the receptances xx, yy and xy (m/N), each of shape (r, k)."""


class _LoopParts(NamedTuple):
    """Parts of the loop matrix that do not depend on the speed, at some frequencies, shape (r, k) each."""

    cutting: Complexes
    """Trace of H0 G (1/m)."""
    damping: Complexes
    """Trace of C / D N0 G (1/m)."""
    flexibility: Complexes
    """Determinant of G (m^2/N^2)."""


class _Bracket(NamedTuple):
    """Steps between two frequencies (Hz) with a real loop, and the resultant at both, shape (r,) or (r, s) each."""

    low: Floats
    high: Floats
    at_low: Floats
    at_high: Floats

    @property
    def frequency(self) -> Floats:
        """Frequencies at which the resultant is 0 on a line (Hz)."""
        rise = self.at_high - self.at_low
        return np.asarray(self.low - self.at_low * (self.high - self.low) / np.where(rise == 0, 1.0, rise))

    def with_inner(self, frequency: Floats, value: Floats) -> "_Bracket":
        """Return the part on one side of a frequency inside."""
        is_low = (value < 0) == (self.at_low < 0)
        low, high = np.where(is_low, frequency, self.low), np.where(is_low, self.high, frequency)
        return _Bracket(low, high, np.where(is_low, value, self.at_low), np.where(is_low, self.at_high, value))


@dataclass(frozen=True, eq=False)
class DampedLoop:
    """Chatter loops of r systems whose flanks damp the tip.

    With the mean force matrix H0, the mean N0 of n n' and f_c / f_t waves in the tooth period of N teeth, the loop is

        L = eigenvalue of ((1 - exp(-i w tau)) H0 + 2 i N (f_c / f_t) (C / D) N0) G,     b = -1 / L,

    as i w C / V = 2 i N (f_c / f_t) C / D. The lowest b counts for which L is real and negative. For uneven teeth the
    regeneration is the mean over the delays. Where the trace t and the determinant d of this matrix share a real b with
    1 + b t + b^2 d = 0, the resultant of its real and imaginary part is 0.
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

    def limits(self, grid: Floats, tooth_frequency: Floats) -> tuple[Floats, Floats]:
        """Return the lowest limit (m) and its frequency (Hz) at tooth frequencies (r, s) in Hz, each of shape (r, s).

        grid (r, k): rising frequencies (Hz) that resolve modes and regeneration. Inf and nan if there is no limit.
        """
        parts = self._parts(grid)
        found = [self._lowest_step(grid, parts, teeth[:, np.newaxis]) for teeth in tooth_frequency.T]
        bracket = _Bracket._make(np.stack(part, axis=1) for part in zip(*found, strict=True))
        for _ in range(REFINEMENT_STEPS):
            frequency = bracket.frequency
            invariants = self._invariants(self._parts(frequency), frequency, tooth_frequency)
            bracket = bracket.with_inner(frequency, self._resultant(*invariants))
        frequency = bracket.frequency
        depth = _real_limit(*self._invariants(self._parts(frequency), frequency, tooth_frequency))
        exists = (bracket.at_low < 0) != (bracket.at_high < 0)
        return np.where(exists, depth, np.inf), np.where(exists & np.isfinite(depth), frequency, np.nan)

    def _parts(self, frequency: Floats) -> _LoopParts:
        xx, yy, xy = self.receptance(frequency)
        traces = (
            part[:, 0, 0, np.newaxis] * xx
            + part[:, 1, 1, np.newaxis] * yy
            + (part[:, 0, 1] + part[:, 1, 0])[:, np.newaxis] * xy
            for part in (self.force, self.damping)
        )
        return _LoopParts(*traces, xx * yy - xy**2)

    @cached_property
    def _determinants(self) -> tuple[Floats, Floats, Floats]:
        """Factors of s^2, s r and r^2 in the determinant of s H0 + r C / D N0, shape (r, 1) each."""
        (h, a), (b, k) = np.moveaxis(self.force, 0, -1)[..., np.newaxis]
        (n, c), (d, m) = np.moveaxis(self.damping, 0, -1)[..., np.newaxis]
        return h * k - a * b, h * m + n * k - a * d - c * b, n * m - c * d

    def _invariants(self, parts: _LoopParts, frequency: Floats, tooth_frequency: Floats) -> tuple[Complexes, Complexes]:
        """Return trace (1/m) and determinant (1/m^2) of the loop matrix, shape (r, k) each."""
        waves = frequency / tooth_frequency
        gain, rate = mean_regeneration(self.cut, waves), 2j * self.cut.teeth * waves
        cutting, both, damping = self._determinants
        determinant = (gain * (gain * cutting + rate * both) + rate**2 * damping) * parts.flexibility
        return gain * parts.cutting + rate * parts.damping, determinant

    def _resultant(self, trace: Complexes, determinant: Complexes) -> Floats:
        """Return what is 0 where the loop is real; with one direction only, the loop is the trace."""
        if not np.any(determinant):
            return trace.imag
        inner = determinant.imag - trace.imag * trace.real
        return np.asarray(determinant.imag * inner + trace.imag**2 * determinant.real)

    def _lowest_step(self, grid: Floats, parts: _LoopParts, tooth_frequency: Floats) -> _Bracket:
        """Return the step of the lowest limit of each system at its tooth frequency (r, 1); of zeros without one."""
        trace, determinant = self._invariants(parts, grid, tooth_frequency)
        value = self._resultant(trace, determinant)
        row, step = np.nonzero((value[:, 1:] < 0) != (value[:, :-1] < 0))
        steps = _Bracket(grid[row, step], grid[row, step + 1], value[row, step], value[row, step + 1])
        share = steps.at_low / (steps.at_low - steps.at_high)
        between = (part[row, step] + share * (part[row, step + 1] - part[row, step]) for part in (trace, determinant))
        order = np.lexsort((_real_limit(*between), row))
        first = order[np.flatnonzero(np.diff(row[order], prepend=-1))]
        lowest = np.zeros((4, len(grid)))
        lowest[:, row[first]] = np.array(steps)[:, first]
        return _Bracket(*lowest)


def _real_limit(trace: Complexes, determinant: Complexes) -> Floats:
    """Return b = -1 / L (m) for the eigenvalue that is nearest to real; inf unless it is negative."""
    half = trace / 2
    root = np.sqrt(half**2 - determinant)
    large = half + np.where(np.abs(half + root) < np.abs(half - root), -root, root)
    loops = np.stack((large, determinant / np.where(large == 0, 1.0, large)))
    skew = np.where(loops.real == 0, np.inf, np.abs(loops.imag) / np.where(loops.real == 0, 1.0, np.abs(loops.real)))
    loop = np.take_along_axis(loops.real, np.argmin(skew, axis=0)[np.newaxis], axis=0)[0]
    return np.where(loop < 0, -1 / np.where(loop < 0, loop, -1.0), np.inf)
