"""Decisions of a person on hits: their options, the flags and the FRF that follow, and mistakes."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition import Circumstances, Hit, HitDecision, HitFlags, Structure, TapTest, estimate_frf
from acquisition.hit_fault import HIT_FAULTS
from acquisition.hit_quality.best_hits import choose_best_hits
from acquisition.hit_quality.decide_hits import (
    UNUSABLE_HIT_FLAGS,
    add_decisions,
    decide_hits,
    merge_decisions,
    parse_hit_decisions,
)
from acquisition.tap_test import decide_flags

RATE, TIME = 10240.0, np.arange(-100, 3996) / 10240.0
PULSE = np.where((TIME >= 0) & (TIME <= 1e-3), np.sin(np.pi * TIME / 1e-3) ** 4, 0.0)
RESPONSE = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7])).response(TIME, 1e-3)
ACCEPT_DOUBLE = HitDecision(2, "accept", ("double-hit",))


def make_hit(peak: float, gain: float = 1.0, seed: int = 0) -> Hit:
    noise = 0.01 * np.random.default_rng(seed).normal(size=TIME.size)
    return Hit(peak * PULSE, gain * peak * RESPONSE + noise, RATE, 100)


def make_tap(*flags: HitFlags) -> TapTest:
    hits = tuple(make_hit(150.0 + 20 * i, 1 + 0.05 * i, i) for i in range(len(flags)))
    good = [hit for hit, faults in zip(hits, flags, strict=True) if not faults]
    about = Circumstances("m", datetime(2026, 3, 2, 9, 30, tzinfo=UTC))
    return TapTest("ID", about, estimate_frf(good), hits, flags)


def test_each_fault_has_a_code_that_gives_it_back() -> None:
    for flag in HIT_FAULTS:
        (code,) = flag.codes
        assert HitFlags.from_codes([code]) is flag
        assert code == code.lower()
        assert code.replace("-", "").isalpha()
    everything = HitFlags.from_codes(code for flag in HIT_FAULTS for code in flag.codes)
    assert HitFlags.from_codes(everything.codes) == everything


def test_the_frf_is_that_of_the_decided_hits_and_the_faults_stay() -> None:
    tap = make_tap(HitFlags.OK, HitFlags.DOUBLE_HIT, HitFlags.OK, HitFlags.OK)
    decided = decide_hits(tap, add_decisions(tap.flags, (), [ACCEPT_DOUBLE, HitDecision(4, "reject")]))
    assert decided.flags == tap.flags
    assert [bool(flags) for flags in decided.decided_flags] == [False, False, False, True]
    assert decided.accepted == tap.hits[:3]
    assert np.array_equal(decided.required_frf.receptance, estimate_frf(tap.hits[:3]).receptance)
    assert np.array_equal(decide_hits(decided, ()).required_frf.receptance, tap.required_frf.receptance)


def test_of_several_decisions_on_a_hit_the_last_one_counts() -> None:
    reject, undo = HitDecision(2, "reject"), HitDecision(2, "undo")
    assert merge_decisions([reject, ACCEPT_DOUBLE]) == (ACCEPT_DOUBLE,)
    assert merge_decisions([ACCEPT_DOUBLE, reject]) == (reject,)
    assert merge_decisions([ACCEPT_DOUBLE, reject, undo]) == ()
    assert decide_flags([HitFlags.OK, HitFlags.DOUBLE_HIT], [reject])[1] == HitFlags.DOUBLE_HIT | HitFlags.UNDONE


@pytest.mark.parametrize(
    "new",
    [
        HitDecision(0, "reject"),
        HitDecision(4, "reject"),
        HitDecision(1, "undo"),
        HitDecision(1, "accept", ("double-hit",)),
        HitDecision(2, "accept", ("too-soft",)),
        HitDecision(3, "accept", ("double-hit",)),
        HitDecision(3, "accept", ("double-hit", "lost-scans")),
    ],
    ids=str,
)
def test_a_decision_that_does_not_fit_its_hit_is_an_error(new: HitDecision) -> None:
    faults = HitFlags.OK, HitFlags.DOUBLE_HIT, HitFlags.DOUBLE_HIT | HitFlags.LOST_SCANS
    with pytest.raises(ValueError, match=str(new.hit)):
        add_decisions(faults, (), [new])


@pytest.mark.parametrize("flag", list(HIT_FAULTS), ids=lambda flag: flag.codes[0])
def test_a_hit_without_force_or_response_is_never_accepted(flag: HitFlags) -> None:
    decision = HitDecision(1, "accept", flag.codes)
    if flag & UNUSABLE_HIT_FLAGS:
        with pytest.raises(ValueError, match="cannot be accepted"):
            add_decisions([flag], (), [decision])
    else:
        assert add_decisions([flag], (), [decision]) == (decision,)


def test_each_fault_of_a_hit_must_be_accepted() -> None:
    faults = [HitFlags.DOUBLE_HIT | HitFlags.TOO_HARD]
    with pytest.raises(ValueError, match="too-hard"):
        add_decisions(faults, (), [HitDecision(1, "accept", ("double-hit",))])
    both = parse_hit_decisions(["1:double-hit", "1:too-hard"])
    assert decide_flags(faults, add_decisions(faults, (), both)) == (HitFlags.OK,)


def test_the_same_decision_again_changes_nothing_and_no_hit_left_is_an_error() -> None:
    reject = HitDecision(1, "reject")
    assert add_decisions([HitFlags.OK], [reject], [reject]) == (reject,)
    with pytest.raises(ValueError, match="none of 2 hits"):
        decide_hits(make_tap(HitFlags.OK, HitFlags.DOUBLE_HIT), [reject])


@pytest.mark.parametrize("text", ["3", "3:", ":double-hit", "x:double-hit", "-1:double-hit", "3:double hit", "3:good"])
def test_an_option_that_is_no_number_and_code_is_an_error(text: str) -> None:
    with pytest.raises(ValueError, match=r"N:CODE|does not exist"):
        parse_hit_decisions([text])


@pytest.mark.parametrize(("accept", "reject", "undo"), [(["1:too-hard"], [1], []), ([], [1], [1])])
def test_two_decisions_on_one_hit_at_once_are_an_error(accept: list[str], reject: list[int], undo: list[int]) -> None:
    with pytest.raises(ValueError, match="hit 1"):
        parse_hit_decisions(accept, reject, undo)


def test_the_best_hits_leave_out_the_one_with_another_frf() -> None:
    hits = [make_hit(200.0, 1.2 if i == 2 else 1.0, i) for i in range(6)]
    assert choose_best_hits(hits, 5) == [0, 1, 3, 4, 5]


def test_the_best_hits_leave_out_the_one_with_another_force_spectrum() -> None:
    wide = np.where((TIME >= 0) & (TIME <= 1.3e-3), np.sin(np.pi * TIME / 1.3e-3) ** 4, 0.0)
    structure = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    slow = Hit(200 * wide, 200 * structure.response(TIME, 1.3e-3), RATE, 100)
    hits = [make_hit(200.0, seed=i) for i in range(4)]
    assert choose_best_hits([*hits[:2], slow, *hits[2:]], 4) == [0, 1, 3, 4]


@given(st.permutations(range(6)), st.floats(0.2, 5.0))
def test_the_choice_depends_neither_on_the_order_nor_on_the_strength_of_the_hits(
    order: list[int], scale: float
) -> None:
    hits = [make_hit(200.0, 1 + 0.02 * (i - 2) ** 2, i) for i in range(6)]
    best = {id(hits[k]) for k in choose_best_hits(hits, 4)}
    shuffled = [hits[i] for i in order]
    assert {id(shuffled[k]) for k in choose_best_hits(shuffled, 4)} == best
    louder = [Hit(scale * hit.force, scale * hit.acceleration, RATE, 100) for hit in hits]
    assert [id(hits[k]) for k in choose_best_hits(louder, 4)] == [id(hits[k]) for k in choose_best_hits(hits, 4)]


def test_of_hits_without_force_the_decay_decides_and_few_hits_are_all_chosen() -> None:
    silent = [Hit(np.empty(0), make_hit(200.0, seed=i).acceleration, RATE, 100) for i in range(4)]
    other = Structure(np.array([650.0]), np.array([0.02]), np.array([2e7])).response(TIME, 1e-3)
    hits = [*silent[:3], Hit(np.empty(0), 200 * other, RATE, 100), silent[3]]
    assert choose_best_hits(hits, 4) == [0, 1, 2, 4]
    assert choose_best_hits(hits, 5) == choose_best_hits(hits, 9) == [0, 1, 2, 3, 4]
