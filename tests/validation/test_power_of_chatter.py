"""Power of cuts that are stable and that chatter, against a plain simulation in time with loss of contact."""

from __future__ import annotations

import math

import numpy as np
import pytest
from learning_study import slot_limits
from milling_steps import Case
from plain_milling import PlainCut, plain_cut

from lobes import Cut
from lobewatch.machine.settings.drive_power import PowerReading

X, Y = ((1500.0, 0.03, 2e7),), ((1400.0, 0.035, 2.2e7),)
KT, KR, FEED, DIAMETER, EDGE = 8e8, 2.4e8, 1e-4, 0.016, 2e4
SPEEDS = (7000.0, 9000.0, 12000.0)
PERIODS, LATE = 240, 120


def simulated(speed_rpm: float, share: float) -> tuple[Case, PlainCut]:
    """Simulate a slot at a share of its limit; return its settled motion."""
    limit = float(slot_limits(X, Y, KT, KR, np.array([0.999, 1.0, 1.001]) * speed_rpm)[1])
    case = Case(X, Y, 0.0, 4, 1.0, "down", KT, KR, 0.0, speed_rpm, share * limit)
    return case, PlainCut(*(record[-LATE:] for record in plain_cut(case, 200, PERIODS)))


def kt_by_power(case: Case, cut: PlainCut, edge: float) -> float:
    """Kt by the mean power over the true one; an edge pushes along its path only where its tooth cuts."""
    tangential = case.depth * (KT * FEED * np.mean(cut.chips) + edge * np.mean(cut.touching))
    power = float(tangential) * math.pi * DIAMETER * case.speed_rpm / 60
    reading = PowerReading(power, Cut(4, 1.0, "down", KT, KR), case.depth, DIAMETER, FEED, edge)
    return reading.at(case.speed_rpm).tangential / KT


@pytest.mark.parametrize("speed_rpm", SPEEDS)
def test_the_power_of_a_stable_cut_says_its_kt(speed_rpm: float) -> None:
    case, cut = simulated(speed_rpm, 0.7)
    assert kt_by_power(case, cut, 0.0) == pytest.approx(1.0, abs=2e-3)
    assert kt_by_power(case, cut, EDGE) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("speed_rpm", SPEEDS)
def test_chips_of_a_cut_that_chatters_are_those_of_its_feed_and_its_edges_rub_less(speed_rpm: float) -> None:
    """Chips are removed once, whatever the tool motion: without edge forces the power is the same."""
    case, cut = simulated(speed_rpm, 1.5)
    assert np.min(cut.touching) < 2
    assert kt_by_power(case, cut, 0.0) == pytest.approx(1.0, abs=0.01)
    assert 0.78 < kt_by_power(case, cut, EDGE) < 0.98
