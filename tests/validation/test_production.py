"""Ordinary cuts on hidden spindles: comparison of the criterion with the time domain, and results of the ladder."""

from __future__ import annotations

import math

import milling_simulation
import numpy as np
import pytest
from learning_study import slot_limits as textbook_limits
from milling_simulation import Case
from production_study import DIAMETER, TEETH, HiddenSpindle, run, slot_limits


def test_without_process_damping_the_limits_are_those_of_the_textbook() -> None:
    spindle = HiddenSpindle(0)
    speeds = np.geomspace(3000, 20000, 40)
    limits, _ = slot_limits(spindle, speeds)
    wanted = textbook_limits(spindle.x, spindle.y, spindle.tangential, spindle.radial, speeds)
    assert np.median(np.abs(limits / wanted - 1)) < 0.002
    assert np.quantile(np.abs(limits / wanted - 1), 0.9) < 0.03


def test_process_damping_raises_the_limits_most_at_low_speed() -> None:
    spindle = HiddenSpindle(1)
    speeds = np.geomspace(spindle.speeds[0], 8 * spindle.speeds[-1], 30)
    damped, _ = slot_limits(spindle, speeds)
    spindle.process_damping = 0.0
    plain, _ = slot_limits(spindle, speeds)
    assert np.all(damped >= 0.98 * plain)
    assert np.median((damped / plain)[:5]) > np.median((damped / plain)[-5:])


def test_the_time_domain_agrees_at_nine_tenths_and_eleven_tenths_of_a_limit() -> None:
    cases, wanted = [], []
    for number in (0, 3):
        spindle = HiddenSpindle(number)
        place = int(np.argmax(np.where(spindle.limits < 6e-3, spindle.speeds * spindle.limits, 0.0)))
        speed, limit = float(spindle.speeds[place]), float(spindle.limits[place])
        for share in (0.9, 1.1):
            forces, depth = (spindle.tangential, spindle.radial, 0.0), share * limit
            damping = spindle.process_damping, DIAMETER
            cases.append(Case(spindle.x, spindle.y, 0.0, TEETH, 1.0, "down", *forces, speed, depth, *damping))
            wanted.append(share > 1)
    assert milling_simulation.chatters(cases).tolist() == wanted


@pytest.mark.timeout(600)
def test_an_ordinary_cut_names_a_better_one_that_is_stable() -> None:
    spindle = HiddenSpindle(0)
    run([spindle], "production", 2)
    assert len(spindle.cuts) == 2
    assert not any(spindle.chattered)
    assert 0.2 < spindle.reached(1) < spindle.reached(2) <= 1


@pytest.mark.long
@pytest.mark.timeout(3000)
def test_the_ladder_reaches_most_of_the_optimum_and_hardly_chatters() -> None:
    spindles = [HiddenSpindle(number) for number in range(40)]
    run(spindles, "production")
    made = sum(len(spindle.chattered) for spindle in spindles)
    assert np.median([spindle.reached(3) for spindle in spindles]) >= 0.55
    assert np.median([spindle.reached(5) for spindle in spindles if not spindle.is_damped]) >= 0.65
    assert sum(sum(spindle.chattered) for spindle in spindles) <= math.ceil(0.05 * made)
