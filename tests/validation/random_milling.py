"""Machines and programs as shops may have them, drawn at random; the depth is the caller's."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from milling_simulation import Case, Modes

IMMERSIONS = (0.05, 0.1, 0.15, 0.25, 0.35, 0.5, 0.75, 1.0)
LOWEST, HIGHEST = 1500.0, 24000.0
"""Spindle speeds (rpm)."""
CYCLES = 25.0
"""Most cycles of the fastest mode in a tooth period."""
FEED_ANGLE: dict[Literal["x", "y"], float] = {"x": 0.0, "y": math.pi / 2}


@dataclass(frozen=True)
class RandomMilling:
    """A machine and all of a program but its depth. SI units; modes are (frequency Hz, damping ratio, stiffness N/m).

    For `lobes`: Cut(teeth, immersion, direction, tangential, radial, helix_lag), and `modes(feed)` as Mode(*mode).
    """

    x: Modes
    """Modes in machine x."""
    y: Modes
    """Modes in machine y."""
    feed: Literal["x", "y", "both"]
    """Machine axis along which the program feeds."""
    teeth: int
    diameter: float
    immersion: float
    direction: Literal["up", "down"]
    tangential: float
    radial: float
    helix: float
    """Helix angle (rad)."""
    speed_rpm: float

    @property
    def helix_lag(self) -> float:
        """2 tan(helix) / diameter (rad/m)."""
        return 2 * math.tan(self.helix) / self.diameter

    def modes(self, feed: Literal["x", "y"]) -> tuple[Modes, Modes]:
        """Modes along the feed and normal to it, where the feed is along a machine axis."""
        return (self.x, self.y) if feed == "x" else (self.y, self.x)

    @property
    def feed_angles(self) -> tuple[float, ...]:
        """Angles of the axes of the feed (rad): one, or two for "both"."""
        return tuple(FEED_ANGLE.values()) if self.feed == "both" else (FEED_ANGLE[self.feed],)

    def case(self, depth: float, feed_angle: float) -> Case:
        """Return the program at a depth (m), fed at an angle (rad) from machine x."""
        return Case(
            self.x,
            self.y,
            feed_angle,
            self.teeth,
            self.immersion,
            self.direction,
            self.tangential,
            self.radial,
            self.helix_lag,
            self.speed_rpm,
            depth,
        )


def random_case(rng: np.random.Generator) -> RandomMilling:
    """One machine and program. All but counts, immersion and axes is uniform or, over decades, log-uniform."""
    x = _modes(rng)
    y = _similar(rng, x)
    teeth = int(rng.integers(1, 9))
    tangential = rng.uniform(500e6, 3000e6)
    slowest = 60 / (teeth * CYCLES) * max(f for f, _, _ in x + y)
    return RandomMilling(
        x,
        y,
        rng.choice(["x", "y", "both"]).item(),
        teeth,
        _between(rng, 6e-3, 40e-3),
        float(rng.choice(IMMERSIONS)),
        rng.choice(["up", "down"]).item(),
        tangential,
        tangential * rng.uniform(0.1, 0.5),
        math.radians(rng.uniform(0, 45)) if rng.random() < 0.7 else 0.0,
        _between(rng, max(LOWEST, slowest), HIGHEST),
    )


def _between(rng: np.random.Generator, low: float, high: float) -> float:
    return math.exp(rng.uniform(math.log(low), math.log(high)))


def _modes(rng: np.random.Generator) -> Modes:
    """Return a dominant mode, and none to five others that are similar or stiffer."""
    stiffness = _between(rng, 5e6, 1e8)
    dominant = (_between(rng, 300, 3000), rng.uniform(0.01, 0.06), stiffness)
    others = (
        (_between(rng, 200, 5000), rng.uniform(0.01, 0.06), stiffness * _between(rng, 0.9, 20))
        for _ in range(rng.integers(0, 6))
    )
    return (dominant, *others)


def _similar(rng: np.random.Generator, modes: Modes) -> Modes:
    """Return modes of the other direction: each shifted a little; in one of three machines all but the dominant new."""
    if rng.random() < 1 / 3:
        modes = (modes[0], *_modes(rng)[1:])
    return tuple(
        (
            f * _between(rng, 0.85, 1.18),
            min(0.06, max(0.01, zeta * _between(rng, 0.7, 1.4))),
            k * _between(rng, 0.6, 1.7),
        )
        for f, zeta, k in modes
    )
