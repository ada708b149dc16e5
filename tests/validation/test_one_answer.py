"""Consistency of `check`, `lobes` and `recommend`; docs/studies/long-tests.md has the last figures."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from one_answer_study import answers, summary
from random_milling import random_case
from verdict_study import MACHINE, assembly, program

from lobewatch.machine.settings.drive_power import CutRange
from lobewatch.verdicts.program_case import ProgramCase
from lobewatch.verdicts.recommendation import find_stable_pockets
from lobewatch.verdicts.setting_robustness import Setting
from lobewatch.verdicts.setting_search import SettingSearch


@pytest.mark.parametrize("seed", [31, pytest.param(32, marks=pytest.mark.long)])
def test_advice_pockets_and_recommendation_are_one_answer_that_holds_when_it_is_entered(seed: int) -> None:
    counts = answers(range(16), seed=seed, most_modes=3, dense=False)
    assert counts.cuts == 2
    assert counts.contradictions == []
    assert counts.refused == []
    assert counts.settings >= counts.cuts


@pytest.mark.long
@pytest.mark.timeout(14400)
def test_of_1000_random_cuts_no_two_answers_contradict_each_other_and_none_is_rejected() -> None:
    counts = answers(range(1000), seed=6, dense=False)
    sys.stdout.write(summary(counts))
    assert counts.cuts >= 600
    assert counts.contradictions == []
    assert counts.refused == []


@pytest.mark.long
@pytest.mark.timeout(14400)
def test_what_is_recommended_is_nearly_the_best_of_a_dense_grid() -> None:
    counts = answers(range(60), seed=7)
    sys.stdout.write(summary(counts))
    assert np.mean(np.array(counts.shares) >= 0.95) >= 0.9


def test_no_depth_is_named_that_would_be_asked_about() -> None:
    """Beyond two diameters `check` asks whether a depth is right, and calls it unknown until then."""
    table = program(random_case(np.random.default_rng(34).spawn(16)[4]), 54.85)
    assert table.depth_mm > 3 * table.tool_diameter_mm
    assert CutRange.of(MACHINE, table).deepest_mm == 2 * table.tool_diameter_mm


def search_of(number: int, depth_mm: float = 1.0) -> SettingSearch:
    """Return the setting search of a random cut with this depth."""
    milling = random_case(np.random.default_rng(6).spawn(number + 1)[number])
    return SettingSearch(ProgramCase(program(milling, depth_mm), assembly(milling), MACHINE))


@pytest.mark.parametrize(("number", "depth_mm"), [(19, 1.0), (234, 1.0), (348, 14.36)])
def test_a_setting_is_found_where_samples_chatter_below_a_depth_at_which_they_are_stable_again(
    number: int, depth_mm: float
) -> None:
    """Few depths are looked at on the way, and step over such islands."""
    search = search_of(number, depth_mm)
    assert search.best is not None
    nearest = search.nearest_window(search.case.table.depth_mm, search.case.table.speed_rpm)
    assert nearest is None or search.best.speed_rpm * search.best.depth_mm >= nearest.speed_rpm * nearest.depth_mm


def test_one_look_at_a_depth_that_chatters_says_how_deep_is_safe() -> None:
    """One of 300 samples chatters from 1.595 mm on, the others deeper."""
    search = search_of(234)
    less = search.verify(24000.0, 2.0)
    assert isinstance(less, float)
    assert less < 1.595
    assert isinstance(search.verify(24000.0, search.cut_range.round_down_depth(less)), Setting)


def test_one_look_at_a_depth_at_which_samples_chatter_in_a_cut_skipped_says_how_deep_is_safe() -> None:
    """The feed directions in which the median is near its limit are checked first."""
    search = search_of(71, 0.4388)
    less = search.verify(15600.0, 1.25)
    assert isinstance(less, float)
    assert 0.95 < less < 1.05
    assert isinstance(search.verify(15600.0, search.cut_range.round_down_depth(less)), Setting)


def test_no_depth_is_named_that_is_so_small_that_it_would_be_asked_about() -> None:
    table, tool = search_of(934).case.table, search_of(934).case.assembly
    named = find_stable_pockets(table, tool, MACHINE)
    assert named
    assert min(setting.depth_mm for setting in named) >= 0.002 * table.tool_diameter_mm > 0.05
