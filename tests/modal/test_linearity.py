"""Natural frequencies of single hits against their force."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from acquisition import Hit, estimate_frf
from lobewatch.tap.emulated_spindle import EMULATED_SAMPLE_RATE
from modal import Mode, fit_modes
from tests.modal.test_hit_scatter import PRE_TRIGGER, RECORD, STRUCTURE, tap


def softening(seed: int, per_100_newton: float, hits: int = 10, spread: float = 200.0) -> list[Hit]:
    """Hits on the spindle of the demo, whose frequencies change by this share for 100 N more than 250 N."""
    random, made = np.random.default_rng(seed), []
    for _ in range(hits):
        peak, width = 250 + spread * random.uniform(-0.5, 0.5), random.uniform(0.55e-3, 0.75e-3)
        share = 1 + per_100_newton * (peak - 250) / 100
        time = (np.arange(RECORD) - PRE_TRIGGER + random.uniform()) / EMULATED_SAMPLE_RATE
        after = time >= 0
        force = np.where(after & (time <= width), np.sin(np.pi * time / width) ** 4, 0.0)
        response = np.zeros(RECORD)
        response[after] = replace(STRUCTURE, frequency=STRUCTURE.frequency * share).response(time[after], width)
        noise = random.normal(size=(2, RECORD))
        made.append(
            Hit(peak * force + 0.1 * noise[0], peak * response + 2 * noise[1], EMULATED_SAMPLE_RATE, PRE_TRIGGER)
        )
    return made


def said(hits: list[Hit]) -> list[str]:
    """Return the remarks on force dependence of the first mode."""
    mode: Mode = fit_modes(estimate_frf(hits), hits=hits)[0]
    return [remark.text for remark in mode.remarks if remark.code == "force-dependent"]


@pytest.mark.parametrize("percent", [-0.5, -0.1, 0.2])
def test_the_slope_is_reported_with_its_error(percent: float) -> None:
    for seed in range(5):
        (text,) = said(softening(seed, percent / 100))
        slope, error = map(float, re.findall(r"([-+.\d]+) ± ([.\d]+) %", text)[0])
        assert abs(slope - percent) < max(4 * error, 0.02 * abs(percent) + 0.005)
        assert ("softens" in text, "stiffens" in text) == (percent < 0, percent > 0)


def test_without_such_a_joint_nothing_is_reported() -> None:
    assert [said(tap(seed)) for seed in range(20)] == [[]] * 20


@pytest.mark.long
def test_in_100_tests_nothing_is_reported_without_such_a_joint() -> None:
    remarks = [
        remark.code
        for seed in range(100)
        for hits in [tap(seed)]
        for mode in fit_modes(estimate_frf(hits), hits=hits)
        for remark in mode.remarks
    ]
    assert "force-dependent" not in remarks


def test_few_hits_equal_forces_and_small_changes_tell_nothing() -> None:
    assert said(softening(0, -0.005, hits=5)) == []
    assert said(softening(0, -0.005, spread=20.0)) == []
    assert said(softening(0, -0.0002)) == []
