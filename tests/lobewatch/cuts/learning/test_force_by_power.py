"""Learning from the power of cuts, against brute-force integration over the common error of all readings."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from lobewatch.cuts.learning.cut_likelihood import (
    CutEvidence,
    PowerEvidence,
    estimate_force_by_power,
    power_distance,
    power_log_likelihood,
)
from lobewatch.cuts.learning.posterior import is_power_inconsistent
from lobewatch.machine.settings.drive_power import CutPower
from tests.lobewatch.cuts.learning.conftest import SLOT, Mill

FORCES = np.array([0.7, 0.9, 1.0, 1.15, 1.6])
"""Kt of a few spindles over that of the table."""
READINGS = [PowerEvidence(1.25, 0.14, 0.05), PowerEvidence(1.1, 0.2, 0.13), PowerEvidence(1.3, 0.14, 0.06)]


def cut(power: PowerEvidence | None, material: int = 0) -> CutEvidence:
    """Build a stable cut so shallow that its verdict says nothing."""
    return CutEvidence(SLOT, 12000, 1e-5, "stable", material=material, power=power)


def one_after_another(cuts: list[CutEvidence]) -> np.ndarray:
    parts = [power_log_likelihood(each, FORCES, cuts[:k]) for k, each in enumerate(cuts)]
    return np.asarray(np.sum(parts, axis=0))


def by_brute_force(readings: list[PowerEvidence]) -> np.ndarray:
    """Logarithm of the integral over e of N(e; 0, 1) times N(log K_i; log K + common_i e, own_i) of all readings."""
    e = np.linspace(-12, 12, 24001)
    log = np.tile(-(e**2) / 2, (len(FORCES), 1))
    for reading in readings:
        off = np.log(reading.force / FORCES)[:, np.newaxis] - reading.common_error * e
        log -= (off / reading.own_error) ** 2 / 2
    return np.asarray(np.log(np.sum(np.exp(log), axis=1)))


def test_the_error_that_all_readings_share_is_integrated_out() -> None:
    for count in (1, 2, 3):
        step, brute = one_after_another([cut(one) for one in READINGS[:count]]), by_brute_force(READINGS[:count])
        assert step - step[2] == pytest.approx(brute - brute[2], abs=1e-6)


def test_no_spindle_is_likelier_than_one_of_the_kt_that_is_read() -> None:
    assert np.all(one_after_another([cut(one) for one in READINGS]) <= 0)
    assert power_log_likelihood(cut(PowerEvidence(1.3, 0.1, 0.05)), np.array([1.3]), [])[0] == 0


def test_cuts_without_power_and_of_another_material_say_nothing() -> None:
    first = cut(READINGS[0])
    assert np.all(power_log_likelihood(cut(None), FORCES, [first]) == 0)
    alone = power_log_likelihood(first, FORCES, [])
    others = [cut(None), cut(READINGS[1], material=1)]
    assert np.array_equal(power_log_likelihood(first, FORCES, others), alone)
    with pytest.raises(ValueError, match=r"cut .*power"):
        power_distance(cut(None), FORCES, [])


@pytest.mark.parametrize("force", [0.7, 1.6])
def test_kt_moves_towards_what_is_read_and_no_closer_than_the_error_that_all_readings_share(
    mill: Mill, force: float
) -> None:
    before = mill.prior.intervals["tangential"]
    read = [replace(cut(PowerEvidence(force, 0.13, 0.05)), depth=1e-5 * (1 + k)) for k in range(4)]
    one, four = (mill.learnt_from(read[:count]).intervals["tangential"] for count in (1, 4))
    assert abs(one.mean - force) < abs(before.mean - force) / 3
    assert (one.mean - before.mean) * (force - before.mean) > 0
    assert one.std < before.std / 2
    assert 0.1 * force < four.std <= 1.1 * one.std


def test_an_old_reading_counts_whole(mill: Mill) -> None:
    read = cut(READINGS[0])
    now, old = (
        mill.prior.learn_from(replace(read, frequency_ratio=moved)).intervals["tangential"] for moved in (1.0, 1.08)
    )
    assert now.mean == pytest.approx(old.mean, rel=1e-3)


def test_edges_make_the_error_larger_and_more_so_where_their_force_is_not_known() -> None:
    """Edges take a quarter of all power: 30 or 50 % of that are 7.5 or 12.5 %."""
    none, known, unknown = (
        estimate_force_by_power(CutPower(1500.0, 1.75e9, share, is_known), SLOT, chatters=False)
        for share, is_known in ((0.0, True), (1 / 3, True), (1 / 3, False))
    )
    assert (none.force, none.common_error, none.own_error) == pytest.approx((1.25, 0.15, 0.05))
    assert (known.force, known.common_error, known.own_error) == pytest.approx((1.25, math.hypot(0.15, 0.075), 0.05))
    assert unknown.common_error == pytest.approx(math.hypot(0.15, 0.125))


def test_a_cut_that_chatters_reads_low_and_scatters() -> None:
    chatter = estimate_force_by_power(CutPower(1500.0, 1.4e9, 0.0, True), SLOT, chatters=True)
    assert (chatter.force, chatter.common_error, chatter.own_error) == pytest.approx(
        (1 / 0.89, 0.15, math.hypot(0.05, 0.08))
    )


def test_a_power_far_from_all_that_was_known_contradicts(mill: Mill) -> None:
    read = PowerEvidence(1.0, 0.13, 0.05)
    learnt = mill.prior.learn_from(cut(read))
    for force, contradicts in ((1.2, False), (0.85, False), (1.5, True), (0.65, True)):
        again = replace(cut(replace(read, force=force)), depth=2e-5)
        assert is_power_inconsistent(learnt.predict(again)) == contradicts
    assert not is_power_inconsistent(mill.prior.predict(cut(replace(read, force=1.5))))
    assert is_power_inconsistent(mill.prior.predict(cut(replace(read, force=9.0))))
    assert not is_power_inconsistent(learnt.predict(cut(None)))
