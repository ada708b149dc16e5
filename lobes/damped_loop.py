"""Stability limits of the mean force with process damping."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lobes.cut import Cut
from lobes.tooth_force import mean_regeneration
from modal.arrays import Complexes, Floats, Indices

REFINEMENT_STEPS = 4
"""Steps of the false position that refine a crossing."""
REFINED_SHARE = 0.75
"""Share of the largest interpolated loop above which a crossing may be the lowest and is refined; chosen."""

Receptances = Callable[[Floats], tuple[Complexes, Complexes, Complexes]]
"""Function from frequencies (r, k) in Hz to the receptances xx, yy and xy (m/N), each of shape (r, k)."""


class LoopParts(NamedTuple):
    """Parts of the loops h +- sqrt(q) that do not depend on the speed, shape (r, k) each.

    With the gain g of the regeneration and the tooth frequency f: h = g cutting + damping / f, and
    q = g (g square + mixed / f) + rest / f^2.
    """

    cutting: Complexes
    """Half the trace of H0 G (1/m)."""
    damping: Complexes
    """Half the trace of B = 2 i N f_c C / D N0 (G - J / (i w)) (Hz/m)."""
    square: Complexes
    """Square of half the trace of H0 G less its determinant (1/m^2)."""
    mixed: Complexes
    """Trace of H0 G B less half the product of both traces (Hz/m^2)."""
    rest: Complexes
    """Square of half the trace of B less its determinant (Hz^2/m^2)."""

    def values(self, gain: Complexes, tooth_frequency: Floats) -> tuple[Complexes, Complexes]:
        """Return half the sum and half the difference of both loops (1/m), shape (r, k) each."""
        per_tooth = 1 / tooth_frequency
        square = gain * (gain * self.square + per_tooth * self.mixed) + per_tooth**2 * self.rest
        return gain * self.cutting + per_tooth * self.damping, _square_root(square)

    def damped(self, level: Floats) -> tuple[Complexes, Complexes]:
        """Return both loops of a cut of gain 1 with flanks that damp as at a level (r, 1), each followed over k.

        level: depth over tooth frequency (m/Hz) of the damping, whatever the depth of the cut. The loops are the
        eigenvalues of (1 + level B)^-1 H0 G.
        """
        moving = level * self.damping
        loop = 1 / (1 + 2 * moving + moving**2 - level**2 * self.rest)
        half = loop * (self.cutting * (1 + moving) - level * self.mixed / 2)
        root = _square_root(half**2 - loop * (self.cutting**2 - self.square))
        root[:, 1:] *= np.cumprod(np.where(np.real(root[:, 1:] * np.conj(root[:, :-1])) < 0, -1.0, 1.0), axis=1)
        return half + root, half - root


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
        parts, shape = self.parts(grid), tooth_frequency.shape
        found = [self._lowest_steps(grid, parts, teeth[:, np.newaxis]) for teeth in tooth_frequency.T]
        column = np.repeat(np.arange(shape[1]), [rows.size for rows, _ in found])
        row, steps = np.concatenate([rows for rows, _ in found]), np.concatenate([part for _, part in found], axis=1)
        order = np.argsort(row, kind="stable")
        row, column = row[order], column[order]
        place = row, np.arange(row.size) - np.searchsorted(row, row)
        padded = np.zeros((5, shape[0], np.max(place[1], initial=-1) + 1), np.complex128)
        padded[4] = 1.0
        padded[:, *place] = np.vstack((steps[:, order], tooth_frequency[row, column]))
        refined, loop = self._refine(_Steps(padded[0].real, padded[1].real, padded[2], padded[3]), padded[4].real)
        return _lowest_limits(shape, row, column, -1 / loop.real[place], refined[place])

    def _refine(self, steps: _Steps, tooth_frequency: Floats) -> tuple[Floats, Complexes]:
        """Return frequencies (Hz) and loops (1/m) of crossings (r, m) in steps."""
        for _ in range(REFINEMENT_STEPS):
            frequency, near = steps.interpolate()
            gain = mean_regeneration(self.cut, frequency / tooth_frequency)
            half, root = self.parts(frequency).values(gain, tooth_frequency)
            is_first = np.abs(half + root - near) < np.abs(half - root - near)
            steps = steps.narrow(frequency, np.where(is_first, half + root, half - root))
        return steps.interpolate()

    def parts(self, frequency: Floats) -> LoopParts:
        """Return the parts of the loops at frequencies (r, k) in Hz."""
        xx, yy, xy = self.receptance(frequency)
        shown = np.array([[xx, xy + 0 * xx], [xy + 0 * xx, yy]])
        jump = np.moveaxis(self.jump, 0, -1)[..., np.newaxis]
        moving = shown + 0.5j / np.pi / np.where(frequency > 0, frequency, 1.0) * jump if np.any(jump) else shown
        cutting, damping = (
            np.einsum("rij,jlrk->ilrk", matrix, part) for matrix, part in ((self.force, shown), (self.damping, moving))
        )
        damping *= 2j * self.cut.teeth * frequency
        half, damped = (cutting[0, 0] + cutting[1, 1]) / 2, (damping[0, 0] + damping[1, 1]) / 2
        mixed = np.einsum("ijrk,jirk->rk", cutting, damping) - 2 * half * damped
        return LoopParts(half, damped, half**2 - _determinant(cutting), mixed, damped**2 - _determinant(damping))

    def _lowest_steps(self, grid: Floats, parts: LoopParts, tooth_frequency: Floats) -> tuple[Indices, Complexes]:
        """Return the rows (c,) and the steps (4, c) of nearly the lowest limits at tooth frequencies (r, 1)."""
        gain = mean_regeneration(self.cut, grid / tooth_frequency, np.float32)
        half, root = parts.values(gain, tooth_frequency)
        alike = root.real[:, 1:] * root.real[:, :-1] + root.imag[:, 1:] * root.imag[:, :-1] >= 0
        first, second = half.imag + root.imag < 0, half.imag - root.imag < 0
        crosses = np.stack(
            [
                before[:, :-1] != np.where(alike, before[:, 1:], after[:, 1:])
                for before, after in ((first, second), (second, first))
            ]
        )
        branch, row, step = np.nonzero(crosses)
        at, sign = np.broadcast_to(grid, half.shape), 1.0 - 2 * branch
        same = np.where(alike[row, step], sign, -sign)
        low, high = half[row, step] + sign * root[row, step], half[row, step + 1] + same * root[row, step + 1]
        steps = _Steps(at[row, step], at[row, step + 1], low, high)
        loop = steps.interpolate()[1].real
        largest = np.zeros(len(half))
        np.minimum.at(largest, row, loop)
        few = loop < REFINED_SHARE * largest[row]
        return row[few], np.array(steps, dtype=np.complex128)[:, few]


def _square_root(values: Complexes) -> Complexes:
    """Return a square root of each value, faster than `np.sqrt`; near the axes it is exact to 1e-8 of its size."""
    size, root = np.abs(values), np.empty_like(values)
    root.real = np.sqrt(np.maximum(size + values.real, 0.0) / 2)
    root.imag = np.copysign(np.sqrt(np.maximum(size - values.real, 0.0) / 2), values.imag)
    return root


def _determinant(matrix: Complexes) -> Complexes:
    """Return the determinants of matrices (2, 2, ...)."""
    return np.asarray(matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0])


def _lowest_limits(
    shape: tuple[int, ...], row: Indices, column: Indices, limit: Floats, frequency: Floats
) -> tuple[Floats, Floats]:
    """Return the lowest limit in each place and its frequency; inf and nan without one."""
    depth, chatter = np.full(shape, np.inf), np.full(shape, np.nan)
    order = np.lexsort((limit, column, row))
    order = order[limit[order] > 0]
    _, begins = np.unique(row[order] * shape[1] + column[order], return_index=True)
    first = order[begins]
    depth[row[first], column[first]], chatter[row[first], column[first]] = limit[first], frequency[first]
    return depth, chatter
