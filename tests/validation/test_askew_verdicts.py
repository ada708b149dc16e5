"""Verdicts on spindles with rotated principal directions against a simulation; docs/lobes.md has the figures."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from askew_study import hold, sayings

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


def test_a_cross_tap_is_asked_for_where_it_can_matter_and_not_once_it_is_there() -> None:
    asked = [
        sum(any(remark.code == "cross-not-tapped" for remark in saying.verdict.remarks) for saying in said)
        for said in (sayings(2, seed=4), sayings(2, seed=4, across=True))
    ]
    assert asked[0] >= 1
    assert asked[1] == 0
