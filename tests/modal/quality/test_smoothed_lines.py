"""Lines smoothed by an analyzer: detected by their noise, and remarked for narrow modes."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition import Frf, estimate_frf, from_accelerance, is_smoothed
from modal import Mode, Trust, assess_trust, fit_modes, synthesize_frf
from tests.modal.test_hit_scatter import tap

F = np.arange(2.0, 3200.0, 2.0)
KERNELS = {"three": np.ones(3) / 3, "five": np.ones(5) / 5, "hann": np.array([0.25, 0.5, 0.25])}


def frf(damping_ratio: float, kernel: str = "", seed: int = 0, noise: float = 0.005) -> Frf:
    """Two modes in noise of this share of the largest accelerance, smoothed over neighbouring lines."""
    exact = synthesize_frf([Mode(800.0, damping_ratio, 5e7), Mode(1500.0, damping_ratio, 3e7)], F).accelerance
    random = np.random.default_rng(seed).normal(size=(2, F.size)) * noise * np.max(np.abs(exact)) / np.sqrt(2)
    lines = exact + random[0] + 1j * random[1]
    return from_accelerance(F, np.convolve(lines, KERNELS[kernel], "same") if kernel else lines)


def at_1500(of: Frf) -> Mode:
    return min(fit_modes(of), key=lambda mode: abs(mode.frequency - 1500))


@pytest.mark.parametrize("noise", [1e-5, 5e-3, 5e-2])
@pytest.mark.parametrize("kernel", KERNELS)
def test_smoothed_lines_are_seen_whatever_the_noise(kernel: str, noise: float) -> None:
    assert all(is_smoothed(frf(0.01, kernel, seed, noise)) for seed in range(10))
    assert not any(is_smoothed(frf(0.01, "", seed, noise)) for seed in range(10))


def test_a_narrow_mode_of_smoothed_lines_is_doubtful_and_a_wide_one_is_not() -> None:
    narrow = at_1500(frf(0.005, "five"))
    assert narrow.damping_ratio / 0.005 > 1.1
    assert assess_trust(narrow) is Trust.DOUBTFUL
    assert "smoothed-lines" in [remark.code for remark in narrow.remarks]
    for fine in (at_1500(frf(0.03, "five")), at_1500(frf(0.005))):
        assert assess_trust(fine) is Trust.TRUSTED
        assert "smoothed-lines" not in [remark.code for remark in fine.remarks]


def test_without_noise_nothing_is_reported_and_an_axis_may_be_uneven() -> None:
    assert not is_smoothed(frf(0.01, "three", noise=0.0))
    assert not is_smoothed(
        Frf(np.geomspace(10, 3000, 800), synthesize_frf([Mode(800.0, 0.01, 5e7)], F).receptance[:800])
    )
    conjugate = Frf(F, frf(0.003).receptance.conj(), measured_as="accelerance")
    assert not is_smoothed(conjugate)


def test_averages_of_hits_are_not_taken_for_smoothed() -> None:
    frfs = [estimate_frf(tap(seed, hits, noise)) for seed in range(15) for hits in (1, 10) for noise in (0.02, 0.5)]
    assert not any(map(is_smoothed, frfs))
