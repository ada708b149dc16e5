"""A spindle, a slot and a doubt that the tests of the learning share."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import reduce

import numpy as np
import pytest

from lobes import Cut, MillingRows, milling_system, rows_of, zero_order
from lobes.floquet import largest_multipliers, piece_numbers
from lobewatch.cuts.learning.cut_evidence import CutEvidence
from lobewatch.cuts.learning.grid import Grid, speeds_between
from lobewatch.cuts.learning.posterior import Posterior, prior
from lobewatch.verdicts.doubt import Doubt, Span
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
        return rows_of(milling_system([self.x], [self.y]), self.cut, np.ones(1))

    @property
    def prior(self) -> Posterior:
        """Before the first cut."""
        return prior(self.middle, doubt(), 700)

    def learnt_from(self, cuts: Iterable[CutEvidence]) -> Posterior:
        """After some cuts."""
        return reduce(Posterior.learn_from, cuts, self.prior)

    @property
    def grid(self) -> Grid:
        """4000 to 20 000 rpm, flutes of 12 mm."""
        speeds = speeds_between(4000, 20000)
        return Grid(self.cut, (0.0,), speeds, np.full(speeds.shape, 0.012), np.ones(speeds.shape))

    @property
    def turning(self) -> tuple[Mode, Mode]:
        """x and y at speed."""
        x, y = (mode.scaled(by, 1.0, "") for mode, by in zip((self.x, self.y), self.frequency, strict=True))
        return x, y

    @property
    def pushed(self) -> Cut:
        """The cut with its force at speed."""
        return replace(self.cut, tangential=self.force * self.cut.tangential, radial=self.force * self.cut.radial)

    def multiplier(self, speed: float, depth: float) -> complex:
        """Of the spindle that turns, by semi-discretisation."""
        x, y = self.turning
        rows = rows_of(milling_system([x], [y]), self.pushed, np.array([speed]))
        return complex(largest_multipliers(rows, np.array([[depth]]), piece_numbers(rows, depth))[0, 0])

    def hear(self, speed: float, depth: float) -> CutEvidence:
        """What the cut sounds like; the frequency is the one that the multiplier leaves next above a natural one."""
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
        """Of a slot a tenth deeper than its limit."""
        x, y = self.turning
        return self.hear(speed, 1.1 * float(zero_order([x], [y], self.pushed, [speed]).depth[0]))


def doubt() -> Doubt:
    """Of a tap test without errors; 20 % of the coefficients."""
    return Doubt({"tap": np.zeros((2, 4))}, np.tile(np.eye(4), (2, 1, 1)), 0.01, Span(0.8, 1.2), Span(0.8, 1.2))


@pytest.fixture
def mill() -> Mill:
    """With a slot of four teeth."""
    return Mill()
