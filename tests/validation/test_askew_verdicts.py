"""Verdicts on spindles with rotated principal directions against a simulation; docs/lobes.md has the figures."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from askew_study import hold, sayings, verdicts_from_hits

from lobewatch.verdicts.verdict import Stability


def say(text: str) -> None:
    """Seen with pytest -rP or -s."""
    sys.stdout.write(f"{text}\n")


@pytest.mark.parametrize("across", [False, True])
@pytest.mark.parametrize(
    "count", [3, pytest.param(120, marks=[pytest.mark.long, pytest.mark.timeout(14400)])], ids=["few", "all"]
)
def test_limits_of_rotated_spindles_are_not_below_what_is_reported(count: int, across: bool) -> None:
    said = sayings(count, seed=1, across=across)
    holds = hold(said, 0.95)
    stable = np.mean([saying.verdict.stability is Stability.STABLE for saying in said])
    say(f"{np.mean(holds):.1%} hold 0.95 of the low end; at half the limit {stable:.1%} are called stable")
    assert np.mean(holds) >= 0.95
    assert stable >= (0.85 if count > 20 else 0.5)


@pytest.mark.parametrize(
    "count", [1, pytest.param(60, marks=[pytest.mark.long, pytest.mark.timeout(7200)])], ids=["few", "all"]
)
def test_frfs_of_rotated_spindles_make_nothing_stable_beyond_the_true_limit(count: int) -> None:
    words = verdicts_from_hits(count, 31, (0.5, 1.05, 1.5))
    say(f"from hits: { ({share: [word.value for word in each] for share, each in words.items()}) }")
    assert [len(each) for each in words.values()] == [count] * 3
    assert Stability.STABLE not in (*words[1.05], *words[1.5])
    assert Stability.NOT_STABLE not in words[0.5]
    assert words[0.5].count(Stability.STABLE) >= (0.75 if count > 20 else 0.5) * count


def test_a_cross_tap_is_asked_for_where_it_can_matter_and_not_once_it_is_there() -> None:
    asked = [
        sum(any(remark.code == "cross-not-tapped" for remark in saying.verdict.remarks) for saying in said)
        for said in (sayings(2, seed=4), sayings(2, seed=4, across=True))
    ]
    assert asked[0] >= 1
    assert asked[1] == 0
