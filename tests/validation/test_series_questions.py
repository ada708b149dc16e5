"""Questions of a series on random machines: honest series are left alone, human errors are not; series_study.py."""

from __future__ import annotations

import sys

import pytest
from series_study import Counts, count_questions, count_silent

GAINS = ("gain", "gain in five steps", "young gain", "young gain in five steps")
KINDS = (*GAINS, "shorter tool", "sensor left at once", "sensor left later")


def say(what: str, *values: object) -> None:
    """Seen with pytest -rP or -s."""
    sys.stdout.write(f"{what}: {' '.join(map(str, values))}\n")


@pytest.mark.parametrize("stiffness_std", [0.03, 0.06])
@pytest.mark.parametrize(
    ("machines", "seed"), [(10, 3), pytest.param(1000, 17, marks=[pytest.mark.long, pytest.mark.timeout(7200)])]
)
def test_an_honest_series_asks_at_most_once(machines: int, seed: int, stiffness_std: float) -> None:
    numbers = count_questions(machines, stiffness_std, seed)
    say(f"K scatter {stiffness_std}", [numbers.count(asked) for asked in range(max(numbers) + 1)])
    assert sum(number <= 1 for number in numbers) >= 0.9 * machines


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("machines", "stiffness_std", "seed", "most"),
    [
        (5, 0.03, 3, Counts(1, 0)),
        pytest.param(500, 0.03, 18, Counts(20, 10), marks=[pytest.mark.long, pytest.mark.timeout(7200)]),
        pytest.param(500, 0.06, 19, Counts(60, 10), marks=[pytest.mark.long, pytest.mark.timeout(7200)]),
    ],
)
def test_a_human_error_is_not_silent(kind: str, machines: int, stiffness_std: float, seed: int, most: Counts) -> None:
    silent = count_silent(kind, machines, stiffness_std, seed)
    say(f"{kind}, K scatter {stiffness_std}, {machines} machines", silent)
    assert silent.at_once <= most.at_once
    assert silent.ever <= most.ever
