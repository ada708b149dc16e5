"""What may differ between a spindle at rest, as it was tapped, and one that turns and cuts: the prior of the learning.

Standard deviations: f_n -1.5 +- 2 %, for each mode apart; zeta x 1.1 +- 25 %, K +- 10 %, for x and y apart; Kt x 1.1
+- 30 %, for each material. Kr/Kt may be anything from 0 to 1, more likely what the program is doubted by. Chosen:
plausible, not measured. They are joined with the doubt of the program. Each number is a function of one that is
standard normal, so that draws can be moved without leaving the prior out of sight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import scipy
from numpy.typing import NDArray

from lobes import MillingRows
from lobewatch.verdicts.doubt import Doubt, Span
from lobewatch.verdicts.draws import DAMPING, FORCE_SPREAD, FREQUENCY, STIFFNESS

FORCE = (1.1, FORCE_SPREAD)
"""Middle of Kt at speed over that of the table, chosen, and its standard deviation relative to that; as FREQUENCY,
DAMPING and STIFFNESS, which are those of the chance of chatter beside a verdict (the deviation of f_n absolute)."""
SHARE, WIDE = 0.05, 3.0
"""Share of frequencies that differ more, and how many times as much; chosen: nobody has measured how often a spindle is
far off."""
LEAST = 0.1
"""Least share of its middle that a factor has."""
MOST_DAMPED = 0.95
"""Largest damping ratio: a mode that is drawn still rings."""
OTHER_RATIO = 0.3
"""Share of the ratios Kr/Kt that are anything from 0 to 1, whatever is published or written down; chosen."""
OF_SIDES, OF_MATERIAL = 4, 3
"""Numbers of a draw beside the f of each mode: (zeta, K) in x, then in y; (Kt at speed, Kt and Kr/Kt as doubted) of
each material."""
REACH, POINTS = 18, 3601
"""End (standard deviations) and number of points of the table that `_quantiles` makes of the mixture."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Draws:
    """Spindles at speed: what was drawn, and what follows for rows of a cut."""

    normal: Floats
    """Numbers for what differs from rest, each standard normal a priori, shape (r, modes + 4 + 3 materials)."""
    at_rest: MillingRows
    """The spindles at rest, with the error of tap tests, r rows; their speeds are what a speed of 1 is truly."""
    doubt: Doubt
    """Doubt that the coefficients were drawn from."""

    def __len__(self) -> int:
        """Number of draws."""
        return len(self.normal)

    def __getitem__(self, places: NDArray[np.intp] | slice) -> Draws:
        """Some of them."""
        return replace(self, normal=self.normal[places], at_rest=self.at_rest[places])

    def with_materials(self, count: int, seed: int) -> Draws:
        """The same with coefficients of so many materials at least, new ones as the prior has them."""
        missing = self._first(count) - self.normal.shape[1]
        if missing <= 0:
            return self
        more = np.random.default_rng((seed, 5, count)).standard_normal((len(self), missing))
        return replace(self, normal=np.hstack((self.normal, more)))

    def ratios(self) -> dict[str, Floats]:
        """What differs from rest as factors: f, zeta and K of "x" and "y", Kt and Kr/Kt of material 0, (r,) each.

        "frequency_x" is that of the mode in x which gives way most, "frequency_x_2" of the next.
        """
        at_rest = self.at_rest
        tangential, ratio = self._coefficients(0, float(at_rest.tangential[0]), float(at_rest.radial[0]))
        frequency, sides, soft = self._frequencies(), self._sides(), np.mean(self._softness(), axis=0)
        values = {"tangential": tangential, "ratio": ratio}
        for axis, side in enumerate("xy"):
            modes = np.flatnonzero(at_rest.axes[at_rest.direction] == axis)
            for place, mode in enumerate(modes[np.argsort(-soft[modes], kind="stable")], 1):
                values[f"frequency_{side}" + (f"_{place}" if place > 1 else "")] = frequency[:, mode]
            if modes.size:
                values |= {f"damping_{side}": sides[:, axis, 0], f"stiffness_{side}": sides[:, axis, 1]}
        return values

    def force(self, material: int) -> Floats:
        """Factors of Kt of a material, shape (r,)."""
        first, doubted = self._first(material), self.doubt.tangential
        at_speed, normal = self.normal[:, first : first + 2].T
        force = doubted.low + (doubted.high - doubted.low) * scipy.special.ndtr(normal)
        return np.asarray(FORCE[0] * np.maximum(1 + FORCE[1] * at_speed, LEAST) * force)

    def rows(self, speed_rpm: float, tangential: float, radial: float, material: int = 0) -> MillingRows:
        """Spindles with a cut of these coefficients (Pa) at a true speed (rpm), fed along x."""
        at_side = self._sides()[:, self.at_rest.axes[self.at_rest.direction]]
        push, ratio = self._coefficients(material, tangential, radial)
        return replace(
            self.at_rest,
            frequency=self.at_rest.frequency * self._frequencies(),
            damping_ratio=np.minimum(self.at_rest.damping_ratio * at_side[..., 0], MOST_DAMPED),
            stiffness=self.at_rest.stiffness * at_side[..., 1],
            speed_rpm=np.full(len(self), speed_rpm),
            tangential=tangential * push,
            radial=radial * push * ratio,
        )

    def _first(self, material: int) -> int:
        """Place of the first number of a material."""
        return _of_spindle(self.at_rest) + OF_MATERIAL * material

    def _softness(self) -> Floats:
        """How far each mode gives way at its natural frequency, at rest (m/N), shape (r, n)."""
        return np.asarray(1 / (2 * self.at_rest.damping_ratio * self.at_rest.stiffness))

    def _frequencies(self) -> Floats:
        """Factors of f of each mode, shape (r, n)."""
        return np.asarray(FREQUENCY[0] + FREQUENCY[1] * _heavy_tailed(self.normal[:, : self.at_rest.direction.size]))

    def _sides(self) -> Floats:
        """Factors of zeta and K in x and y, shape (r, 2, 2)."""
        first = self.at_rest.direction.size
        normal = self.normal[:, first : first + OF_SIDES].reshape(-1, 2, 2)
        parts = (
            middle * np.maximum(1 + spread * normal[..., place], LEAST)
            for place, (middle, spread) in enumerate((DAMPING, STIFFNESS))
        )
        return np.stack(tuple(parts), axis=-1)

    def _coefficients(self, material: int, tangential: float, radial: float) -> tuple[Floats, Floats]:
        """Factors of Kt and of Kr/Kt of a material with these coefficients (Pa), shape (r,) each."""
        direction = self.normal[:, self._first(material) + OF_MATERIAL - 1]
        ratio = _wide_ratio(scipy.special.ndtr(direction), self.doubt.ratio, radial / tangential)
        return self.force(material), np.maximum(ratio, 0.0)


def draw_prior(middle: MillingRows, doubt: Doubt, count: int, seed: int = 0) -> Draws:
    """Draws from the prior around a spindle at rest (a row), the same for a seed."""
    at_rest = doubt.draw(replace(middle, speed_rpm=np.ones(1)), count, seed, without="coefficients")
    normal = np.random.default_rng((seed, 2)).standard_normal((count, _of_spindle(middle) + OF_MATERIAL))
    return Draws(normal, at_rest, doubt)


def _of_spindle(rows: MillingRows) -> int:
    """Number of numbers of a draw that are not of a material."""
    return rows.direction.size + OF_SIDES


def _wide_ratio(share: Floats, doubted: Span, middle: float) -> Floats:
    """Factors on a ratio Kr/Kt below which shares of the prior lie: within its doubt, or anything from 0 to 1.

    Both are even, so that shares are straight lines between their ends; a Kr of 0 stays as doubted.
    """
    if middle <= 0:
        return np.asarray(doubted.low + (doubted.high - doubted.low) * share)
    ends = np.sort([doubted.low, doubted.high, 0.0, 1 / middle])
    width = max(doubted.high - doubted.low, 1e-9)
    below = (1 - OTHER_RATIO) * np.clip((ends - doubted.low) / width, 0, 1) + OTHER_RATIO * np.clip(ends * middle, 0, 1)
    return np.asarray(np.interp(share, below, ends))


def _heavy_tailed(normal: Floats) -> Floats:
    """Standard normal numbers as those of a mixture of which a share is wider, of the same order."""
    return np.asarray(np.interp(normal, *_quantiles()))


@cache
def _quantiles() -> tuple[Floats, Floats]:
    """Standard normal numbers, and those of the mixture that as many lie below."""
    value = np.linspace(-REACH, REACH, POINTS)
    beyond = (1 - SHARE) * scipy.special.ndtr(-np.abs(value)) + SHARE * scipy.special.ndtr(-np.abs(value) / WIDE)
    return np.asarray(-np.sign(value) * scipy.special.ndtri(beyond)), value
