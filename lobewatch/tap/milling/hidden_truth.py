"""How an emulated spindle at speed, and its cut, differ from what was tapped and what stands in machine.toml."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from acquisition import Structure
from lobewatch.cuts.learning.priors import DAMPING, FORCE, FREQUENCY, STIFFNESS

LEAST = 0.3
"""Nothing falls below this share of its middle."""
OFF_COMMAND = 0.015
"""The spindle turns up to so much slower or faster than it is told, as a share."""
RUNOUT = 20e-6
"""Largest eccentricity of a tool in its holder (m)."""


class ModeFactors(NamedTuple):
    """Factors on the modes of one direction."""

    frequency: float
    damping_ratio: float
    stiffness: float

    def of(self, rest: Structure) -> Structure:
        """The same structure at speed."""
        return Structure(
            rest.frequency * self.frequency, rest.damping_ratio * self.damping_ratio, rest.stiffness * self.stiffness
        )


class HiddenTruth(NamedTuple):
    """What nobody has measured."""

    x: ModeFactors
    """Modes in x."""
    y: ModeFactors
    """Modes in y."""
    tangential: float
    """Factor on both cutting coefficients."""
    speed: float
    """Factor on the speed that it is told."""

    @property
    def told(self) -> dict[str, float]:
        """The factors by name."""
        sides = {"x": self.x, "y": self.y}
        modes = {f"{name}_{side}": value for side, one in sides.items() for name, value in one._asdict().items()}
        return modes | {"tangential": self.tangential, "speed": self.speed}


def hidden_truth(seed: int) -> HiddenTruth:
    """The same for a seed, whatever is cut; modes in x and y differ apart."""
    random = np.random.default_rng([seed, 1])
    x, y = (ModeFactors(*(_drawn(random, *one) for one in (FREQUENCY, DAMPING, STIFFNESS))) for _ in range(2))
    return HiddenTruth(x, y, _drawn(random, *FORCE), 1 + random.uniform(-OFF_COMMAND, OFF_COMMAND))


def runout_of(teeth: int, random: np.random.Generator) -> tuple[float, ...]:
    """How far each tooth of an eccentric tool stands out (m)."""
    angle = 2 * np.pi * np.arange(teeth) / teeth + random.uniform(0, 2 * np.pi)
    return tuple((random.uniform(0, RUNOUT) * np.cos(angle)).tolist())


def _drawn(random: np.random.Generator, middle: float, spread: float) -> float:
    return float(middle * max(1 + spread * random.standard_normal(), LEAST))
