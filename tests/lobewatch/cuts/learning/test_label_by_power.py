"""A wrong "stable" is told by the power of the cut, as chatter lowers it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from lobewatch.cuts.learning import drive_gain
from lobewatch.cuts.learning.cut_likelihood import CutEvidence, PowerEvidence
from lobewatch.cuts.learning.posterior import Posterior, wrong_label_probability
from lobewatch.machine.journal.entries import CutVerdict
from tests.lobewatch.cuts.learning.conftest import SLOT, Mill

STABLE, CHATTER = (0.0, 0.05), (math.log(0.89), math.hypot(0.05, 0.08))
"""Mean and scatter of the logarithm of the power over that of a stable cut."""


def made(verdict: CutVerdict, shown: float, depth: float = 2e-3) -> CutEvidence:
    """Build a cut without a frequency; shown: its power over that of a stable one with the Kt of the table."""
    mean, scatter = CHATTER if verdict == "chatter" else STABLE
    return CutEvidence(SLOT, 12000, depth, verdict, power=PowerEvidence(shown / math.exp(mean), 0.15, scatter))


def integrate(log_readings: list[float], log_force: float, kinds: list[tuple[float, float]]) -> float:
    """Integrate the density of readings (log power) over the error that all have in common."""
    error = np.linspace(-10, 10, 20001)
    density = np.exp(-(error**2) / 2)
    for reading, (mean, scatter) in zip(log_readings, kinds, strict=True):
        density *= np.exp(-(((reading - log_force - mean - 0.15 * error) / scatter) ** 2) / 2) / scatter
    return float(np.sum(density))


@pytest.mark.parametrize("shown", [0.8, 0.95, 1.05])
def test_the_ratio_is_that_of_the_densities_integrated_over_the_common_error(
    mill: Mill, monkeypatch: pytest.MonkeyPatch, shown: float
) -> None:
    monkeypatch.setattr(drive_gain, "WRONG_GAIN_SHARE", 1e-12)
    samples, first = mill.prior.samples[:6], made("stable", 1.0, 1e-3)
    ratio = drive_gain.wrong_stable_log_ratio(made("stable", shown), samples, [first])
    for force, found in zip(samples.force_factors(0), ratio, strict=True):
        wrong, right = (
            integrate([0.0, math.log(shown)], math.log(force), [STABLE, kind]) for kind in (CHATTER, STABLE)
        )
        assert found == pytest.approx(math.log(wrong / right), abs=0.01)


def test_chatter_may_have_full_power(mill: Mill) -> None:
    samples, first = mill.prior.samples[:6], made("stable", 1.0, 1e-3)
    assert not np.any(drive_gain.wrong_stable_log_ratio(made("chatter", 1.0), samples, [first]))
    assert not np.any(drive_gain.wrong_stable_log_ratio(replace(first, power=None), samples, [first]))


def wrong_probability(posterior: Posterior, cut: CutEvidence) -> float:
    return wrong_label_probability(posterior.predict(cut))


def test_a_stable_word_with_the_power_of_chatter_is_doubted_and_does_not_lower_kt(mill: Mill) -> None:
    first = made("stable", 1.1, 1e-3)
    doubtful, usual = made("stable", 0.78 * 1.1), made("stable", 1.1)
    learnt = mill.learnt_from([first, doubtful])
    assert wrong_probability(learnt, doubtful) > 0.5
    assert wrong_probability(mill.learnt_from([first, usual]), usual) < 0.1
    assert learnt.intervals["tangential"].mean > mill.learnt_from([first]).intervals["tangential"].mean - 0.05
