"""No verdict `stable` beyond the true limit after taps whose spindle changed; docs/studies/disturbed-taps.md."""

from __future__ import annotations

import functools
import sys

import pytest
from disturbed_study import KINDS, Counts, judge_disturbed, judge_undisturbed

from lobewatch.verdicts.verdict import Stability

counted = functools.cache(judge_disturbed)
"""Counts of a kind, a number of machines and a seed."""


def say(what: str, counts: Counts) -> None:
    """Seen with pytest -rP or -s."""
    words = ", ".join(f"{number} {word}" for word, number in counts.words.items())
    sys.stdout.write(f"{what}: {words}, {counts.uncovered} not covered, {counts.wrong} wrong\n")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("count", "seed"), [(3, 5), pytest.param(50, 11, marks=[pytest.mark.long, pytest.mark.timeout(7200)])]
)
def test_nothing_is_stable_beyond_the_least_limit_of_the_states_met(kind: str, count: int, seed: int) -> None:
    counts = counted(kind, count, seed)
    say(kind, counts)
    assert counts.words.total() == count
    assert counts.wrong == 0


def test_without_the_comparison_a_mode_that_is_in_some_hits_would_leave_the_verdict() -> None:
    """The kind whose modes the fit rejects most often: the comparison says so on each of these machines."""
    assert counted("in some hits", 3, 5).uncovered >= 2


@pytest.mark.long
@pytest.mark.timeout(7200)
@pytest.mark.parametrize(("part", "least"), [(0.5, 0.74), (0.7, 0.55)])
def test_undisturbed_taps_stay_stable_as_often_as_before(part: float, least: float) -> None:
    """Before the comparison: 78 and 59 % of the programs, with a standard error of 5 % for 100 machines."""
    counts = judge_undisturbed(part, 100, 12)
    say(f"undisturbed, {part:.0%} of the limit", counts)
    assert counts.uncovered <= 2
    assert counts.words[Stability.STABLE] >= least * counts.words.total()
