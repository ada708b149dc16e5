"""Spindle, slot and uncertainty shared by the learning tests."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import reduce

import numpy as np
import pytest
from speed_grid import list_speeds

from lobes import Cut, MillingRows, build_milling_system, rows_at_speeds, zero_order_lobes
from lobes.floquet import count_pieces, largest_multipliers
from lobewatch.cuts.learning.cut_likelihood import CutEvidence
from lobewatch.cuts.learning.posterior import Posterior, build_prior
from lobewatch.cuts.learning.suggestion import CutGrid
from lobewatch.verdicts.uncertainty import FactorRange, Uncertainty
from modal import Mode

SLOT = Cut(teeth=4, immersion=1.0, direction="down", tangential=1.4e9, radial=5e8)


@dataclass
class Mill:
    """A spindle as it was tapped, and as it is when it turns."""

    cut: Cut = SLOT
    x: Mode = field(default_factory=lambda: Mode(1713.0, 0.029, 3.5e7))
    y: Mode = field(default_factory=lambda: Mode(1400.0, 0.035, 2.5e7))
    force: float = 1.0
    """Kt at speed over that of the cut."""
    frequency: tuple[float, float] = (0.985, 0.985)
    """At speed over that at rest, x and y."""

    @property
    def middle(self) -> MillingRows:
        """At rest."""
        return rows_at_speeds(build_milling_system([self.x], [self.y]), self.cut, np.ones(1))

    @property
    def prior(self) -> Posterior:
        """Before the first cut."""
        return build_prior(self.middle, doubt(), 700)

    def learnt_from(self, cuts: Iterable[CutEvidence]) -> Posterior:
        """After some cuts."""
        return reduce(Posterior.learn_from, cuts, self.prior)

    @property
    def grid(self) -> CutGrid:
        """4000 to 20 000 rpm, flutes of 12 mm."""
        speeds = list_speeds(4000, 20000)
        return CutGrid(self.cut, (0.0,), speeds, np.full(speeds.shape, 0.012), np.ones(speeds.shape))

    @property
    def turning(self) -> tuple[Mode, Mode]:
        """X and y at speed."""
        x, y = (mode.scaled(by, 1.0, "") for mode, by in zip((self.x, self.y), self.frequency, strict=True))
        return x, y

    @property
    def pushed(self) -> Cut:
        """The cut with its force at speed."""
        return replace(self.cut, tangential=self.force * self.cut.tangential, radial=self.force * self.cut.radial)

    def multiplier(self, speed: float, depth: float) -> complex:
        """Return the multiplier of the rotating spindle by semi-discretization."""
        x, y = self.turning
        rows = rows_at_speeds(build_milling_system([x], [y]), self.pushed, np.array([speed]))
        return complex(largest_multipliers(rows, np.array([[depth]]), count_pieces(rows, depth))[0, 0])

    def hear(self, speed: float, depth: float) -> CutEvidence:
        """Simulate the sound of a cut; the frequency is the one that the multiplier leaves next above a natural one."""
        multiplier = self.multiplier(speed, depth)
        if abs(multiplier) < 1:
            return CutEvidence(self.cut, speed, depth, "stable")
        teeth = self.cut.teeth * speed / 60
        base = abs(np.angle(multiplier)) / (2 * np.pi) * teeth
        family = np.concatenate([np.arange(20) * teeth + base, np.arange(1, 20) * teeth - base])
        own = np.array([self.x.frequency * self.frequency[0], self.y.frequency * self.frequency[1]])
        near = np.min(np.abs(family[:, np.newaxis] / own - 1.02), axis=1)
        return CutEvidence(self.cut, speed, depth, "chatter", float(family[np.argmin(near)]))

    def chatter(self, speed: float) -> CutEvidence:
        """Return evidence of a slot a tenth deeper than its limit."""
        x, y = self.turning
        return self.hear(speed, 1.1 * float(zero_order_lobes([x], [y], self.pushed, [speed]).depth[0]))


def doubt() -> Uncertainty:
    """Return the uncertainty of a tap test without errors, with 20 % for the coefficients."""
    return Uncertainty(
        {"tap": np.zeros((2, 4))}, np.tile(np.eye(4), (2, 1, 1)), 0.01, FactorRange(0.8, 1.2), FactorRange(0.8, 1.2)
    )


@pytest.fixture
def mill() -> Mill:
    """With a slot of four teeth."""
    return Mill()
