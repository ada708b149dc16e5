"""First recommendations and verdicts for listed materials, on truths over the published range."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from first_setting_study import CATALOGUE, FAST, Outcome, chattering, check_program, recommend_first

from lobewatch.machine import Machine

MACHINES = {"catalogue": CATALOGUE, "fast": FAST}


def settled(outcomes: list[Outcome]) -> list[Outcome]:
    return [outcome for outcome in outcomes if outcome.cases]


def test_a_first_recommendation_does_not_chatter() -> None:
    outcome = recommend_first(14, FAST)
    assert outcome.material == "EN-GJL-250"
    assert 0.25 < outcome.share < 1
    assert not np.any(chattering([outcome]))


@pytest.mark.long
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("machine", [pytest.param(machine, id=name) for name, machine in MACHINES.items()])
def test_first_recommendations_reach_three_tenths_of_the_optimum_and_do_not_chatter(machine: Machine) -> None:
    outcomes = [recommend_first(number, machine) for number in range(100)]
    shares, chatter = [outcome.share for outcome in outcomes], chattering(settled(outcomes))
    sys.stdout.write(f"median {np.median(shares):.2f}, {np.sum(chatter)} of {chatter.size} chatter\n")
    assert np.median(shares) >= 0.3
    assert np.mean(chatter) <= 0.01


@pytest.mark.long
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("machine", [pytest.param(machine, id=name) for name, machine in MACHINES.items()])
def test_programs_in_listed_materials_called_stable_do_not_chatter(machine: Machine) -> None:
    stable = settled([check_program(number, machine) for number in range(100)])
    chatter = chattering(stable)
    sys.stdout.write(f"{np.sum(chatter)} of {chatter.size} chatter\n")
    assert chatter.size >= 20
    assert np.mean(chatter) <= 0.01
