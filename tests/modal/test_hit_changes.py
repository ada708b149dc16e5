"""Modes that change from hit to hit: found with their size, and nothing found in undisturbed hits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition import Hit, Structure
from modal import HitChange, HitChangeKind, find_hit_changes
from tests.modal.disturbed_hits import HARD_TIP, SOFT_TIP, Share, draw_structure, tap_structure

ZETA = 0.012
SPINDLE = Structure(np.array([700.0, 1300.0, 2300.0]), np.full(3, ZETA), np.array([2e8, 2.5e7, 6e8]))
LOOSE = Structure(np.array([700.0, 2300.0]), np.full(2, ZETA), np.array([2e8, 6e8]))


def tap(share: Share, seed: int = 1, hits: int = 10) -> list[Hit]:
    return tap_structure([SPINDLE] * hits, seed, share=share)


def first(hits: list[Hit]) -> HitChange:
    """Return the change of the most flexible mode."""
    return find_hit_changes(hits)[0]


@pytest.mark.parametrize("ratios", [-2.0, -1.0, 0.3, 1.0])
def test_a_drift_is_found_with_its_size(ratios: float) -> None:
    change = first(tap(lambda number, _: 1 + ratios * ZETA * number / 9))
    assert (change.kind, change.n_hits, change.is_highest) == (HitChangeKind.DRIFT, 10, True)
    assert change.frequency == pytest.approx(1300 * (1 + ratios * ZETA / 2), rel=1e-3)
    assert change.spread == pytest.approx(1300 * ratios * ZETA, abs=0.03 * 1300 * ZETA)
    assert change.per_hit == pytest.approx(change.spread / 9)
    assert change.relative_spread == pytest.approx(abs(ratios), abs=0.05)
    assert change.damping_ratio == pytest.approx(ZETA, rel=0.03)


@pytest.mark.parametrize("ratios", [0.5, 2.0, 5.0])
def test_two_states_are_found_with_their_hits(ratios: float) -> None:
    other = {2, 3, 7, 9}
    change = first(tap(lambda number, _: 1 - ratios * ZETA * (number in other)))
    assert (change.kind, {*change.hits}) == (HitChangeKind.TWO_STATES, other)
    assert change.spread == pytest.approx(1300 * ratios * ZETA, rel=0.05)


def test_a_change_with_force_is_not_taken_for_a_drift() -> None:
    change = first(tap(lambda _, peak: 1 - ZETA * (peak - 250) / 200))
    assert change.kind is HitChangeKind.FORCE
    assert change.spread < 0
    assert 0.6 < change.relative_spread < 1.1


def test_a_mode_in_three_of_ten_hits_is_found_with_these_hits() -> None:
    present = {1, 4, 8}
    hits = tap_structure([SPINDLE if number in present else LOOSE for number in range(10)], seed=3)
    changes = [change for change in find_hit_changes(hits) if change.kind is HitChangeKind.PARTIAL]
    assert [({*change.hits}, round(change.frequency, -1)) for change in changes] == [(present, 1300)]
    assert changes[0].relative_spread == np.inf


def test_one_hit_of_another_frequency_is_scatter() -> None:
    assert first(tap(lambda number, _: 1 - ZETA * (number == 4))).kind is HitChangeKind.SCATTER


def test_a_drift_is_found_without_force() -> None:
    hits = [replace(hit, force=np.empty(0)) for hit in tap(lambda number, _: 1 - ZETA * number / 9)]
    change = first(hits)
    assert change.kind is HitChangeKind.DRIFT
    assert change.relative_spread == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("hits", [0, 1, 3])
def test_fewer_than_four_hits_tell_nothing(hits: int) -> None:
    assert find_hit_changes(tap(lambda number, _: 1 - ZETA * number, hits=hits)) == []


def test_small_changes_are_not_reported() -> None:
    assert find_hit_changes(tap(lambda number, _: 1 - 0.06 * ZETA * number / 9)) == []


def test_two_equal_hits_without_response_leave_the_change_of_the_others() -> None:
    hits = tap(lambda number, _: 1 - ZETA * number / 9)
    expected, silent = first(hits), {4, 5}
    for number in silent:
        hits[number] = replace(hits[number], acceleration=np.zeros_like(hits[number].acceleration))
    partial, drift = find_hit_changes(hits)[:2]
    assert (partial.kind, {*partial.hits}) == (HitChangeKind.PARTIAL, {*range(10)} - silent)
    assert drift.kind is HitChangeKind.DRIFT
    assert drift.spread == pytest.approx(expected.spread, rel=0.01)


def test_hits_of_two_lengths_are_rejected() -> None:
    hits = tap(lambda *_: 1.0)
    hits[3] = replace(hits[3], force=hits[3].force[:-1], acceleration=hits[3].acceleration[:-1])
    with pytest.raises(ValueError, match="differ in length"):
        find_hit_changes(hits)


def test_the_unit_of_the_force_does_not_matter() -> None:
    hits = tap(lambda number, _: 1 - 0.5 * ZETA * number / 9)
    in_pounds = [replace(hit, force=hit.force / 4.448) for hit in hits]
    one, other = first(hits), first(in_pounds)
    assert other.kind is one.kind
    assert other.spread == pytest.approx(one.spread, rel=1e-6)
    assert other.peak == pytest.approx(4.448 * one.peak)


def close_pair(seed: int) -> Structure:
    """Return two modes of which a hit may show one peak or two."""
    random = np.random.default_rng([seed, 2])
    zeta = random.uniform(0.006, 0.04)
    frequency = 900 * np.array([1, 1 + zeta * random.uniform(0.3, 4)])
    return Structure(frequency, np.full(2, zeta), 3e7 * np.array([1, random.uniform(0.5, 2)]))


def count_said(structures: list[Structure], tip: tuple[float, float] = HARD_TIP) -> int:
    """Return how many undisturbed tap tests of 4 to 20 hits are said to change."""
    tests = [tap_structure([s] * (4 + seed % 17), seed, noise=2.0, tip=tip) for seed, s in enumerate(structures)]
    return sum(bool(find_hit_changes(hits)) for hits in tests)


def test_undisturbed_hits_tell_nothing() -> None:
    assert count_said([draw_structure(seed) for seed in range(12)]) == 0
    assert count_said([close_pair(seed) for seed in range(12)]) == 0
    assert count_said([draw_structure(seed) for seed in range(12)], SOFT_TIP) == 0


@pytest.mark.long
def test_at_most_one_of_200_undisturbed_tests_is_said_to_change() -> None:
    assert count_said([draw_structure(seed) for seed in range(100, 250)]) <= 1
    assert count_said([close_pair(seed) for seed in range(100, 150)]) <= 1
    assert count_said([draw_structure(seed) for seed in range(100, 200)], SOFT_TIP) <= 1


DISTURBANCES: dict[str, Share] = {
    "drift": lambda number, _: number / 9,
    "states": lambda number, _: number % 2,
    "force": lambda _, peak: (peak - 250) / 200,
}


@pytest.mark.long
@pytest.mark.parametrize("kind", [*DISTURBANCES, "partial"])
def test_at_least_95_percent_of_disturbed_tests_are_found(kind: str) -> None:
    found = 0
    for seed in range(40):
        structure, random = draw_structure(seed), np.random.default_rng([seed, 3])
        size = random.uniform(0.3 if kind == "drift" else 0.5, 2.0) * structure.damping_ratio[0]
        if kind == "partial":
            missing = replace(structure, stiffness=np.array([1e13, *structure.stiffness[1:]]))
            hits = tap_structure([structure if number < 3 else missing for number in range(10)], seed)
        else:
            share = DISTURBANCES[kind]
            hits = tap_structure([structure] * 10, seed, share=lambda n, p, d=size, s=share: 1 - d * s(n, p))  # type: ignore[misc]
        found += bool(find_hit_changes(hits))
    assert found >= 38
