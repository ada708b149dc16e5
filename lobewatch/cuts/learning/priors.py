"""What may differ between a spindle at rest, as it was tapped, and one that turns and cuts: the prior of the learning.

Standard deviations: f_n -1.5 +- 2 %, zeta x 1.1 +- 25 %, K +- 10 %, each for x and y apart; Kt x 1.1 +- 30 %, for each
material. Chosen: plausible, not measured. They are joined with the doubt of the program. Each number is a function of
one that is standard normal, so that draws can be moved without leaving the prior out of sight.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from lobes import MillingRows
from lobewatch.verdicts.doubt import Doubt
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
OF_MODES, OF_MATERIAL = 6, 3
"""Numbers of a draw: (f, zeta, K) in x, then in y; (Kt at speed, Kt and Kr/Kt as doubted) of each material."""
REACH, POINTS = 18, 3601
"""End (standard deviations) and number of points of the table that `_quantiles` makes of the mixture."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Draws:
    """Spindles at speed: what was drawn, and what follows for rows of a cut."""

    normal: Floats
    """Numbers for what differs from rest, each standard normal a priori, shape (r, 6 + 3 materials)."""
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
        missing = OF_MODES + OF_MATERIAL * count - self.normal.shape[1]
        if missing <= 0:
            return self
        more = np.random.default_rng((seed, 5, count)).standard_normal((len(self), missing))
        return replace(self, normal=np.hstack((self.normal, more)))

    def ratios(self) -> dict[str, Floats]:
        """What differs from rest as factors: f, zeta and K of "x" and "y", Kt and Kr/Kt of material 0, (r,) each."""
        modes = (name + side for side in ("_x", "_y") for name in ("frequency", "damping", "stiffness"))
        tangential, ratio = self._coefficients(0)
        values = dict(zip(modes, self._modes().reshape(len(self), -1).T, strict=True))
        return values | {"tangential": tangential, "ratio": ratio}

    def rows(self, speed_rpm: float, tangential: float, radial: float, material: int = 0) -> MillingRows:
        """Spindles with a cut of these coefficients (Pa) at a true speed (rpm), fed along x."""
        factor, axis = self._modes(), self.at_rest.axes[self.at_rest.direction]
        push, ratio = self._coefficients(material)
        return replace(
            self.at_rest,
            frequency=self.at_rest.frequency * factor[:, axis, 0],
            damping_ratio=np.minimum(self.at_rest.damping_ratio * factor[:, axis, 1], MOST_DAMPED),
            stiffness=self.at_rest.stiffness * factor[:, axis, 2],
            speed_rpm=np.full(len(self), speed_rpm),
            tangential=tangential * push,
            radial=radial * push * ratio,
        )

    def _modes(self) -> Floats:
        """Factors of f, zeta and K in x and y, shape (r, 2, 3)."""
        normal = self.normal[:, :OF_MODES].reshape(-1, 2, 3)
        parts = (
            FREQUENCY[0] + FREQUENCY[1] * _heavy_tailed(normal[..., 0]),
            DAMPING[0] * np.maximum(1 + DAMPING[1] * normal[..., 1], LEAST),
            STIFFNESS[0] * np.maximum(1 + STIFFNESS[1] * normal[..., 2], LEAST),
        )
        return np.stack(parts, axis=-1)

    def _coefficients(self, material: int) -> tuple[Floats, Floats]:
        """Factors of Kt and of Kr/Kt of a material, shape (r,) each."""
        first = OF_MODES + OF_MATERIAL * material
        at_speed, tangential, ratio = self.normal[:, first : first + OF_MATERIAL].T
        force, ratio = (
            span.low + (span.high - span.low) * ndtr(normal)
            for span, normal in ((self.doubt.tangential, tangential), (self.doubt.ratio, ratio))
        )
        return FORCE[0] * np.maximum(1 + FORCE[1] * at_speed, LEAST) * force, np.maximum(ratio, 0.0)


def draw_prior(middle: MillingRows, doubt: Doubt, count: int, seed: int = 0) -> Draws:
    """Draws from the prior around a spindle at rest (a row), the same for a seed."""
    at_rest = doubt.draw(replace(middle, speed_rpm=np.ones(1)), count, seed, without="coefficients")
    normal = np.random.default_rng((seed, 2)).standard_normal((count, OF_MODES + OF_MATERIAL))
    return Draws(normal, at_rest, doubt)


def _heavy_tailed(normal: Floats) -> Floats:
    """Standard normal numbers as those of a mixture of which a share is wider, of the same order."""
    return np.asarray(np.interp(normal, *_QUANTILES))


def _quantiles() -> tuple[Floats, Floats]:
    """Standard normal numbers, and those of the mixture that as many lie below."""
    value = np.linspace(-REACH, REACH, POINTS)
    beyond = (1 - SHARE) * ndtr(-np.abs(value)) + SHARE * ndtr(-np.abs(value) / WIDE)
    return np.asarray(-np.sign(value) * ndtri(beyond)), value


_QUANTILES = _quantiles()
