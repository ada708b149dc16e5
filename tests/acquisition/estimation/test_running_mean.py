"""The running mean of good hits: equal to the estimate from all of them, also after one was taken back."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import (
    Channel,
    HammeredStructure,
    Hit,
    RunningMean,
    SimulatedSource,
    Trigger,
    capture_hits,
    estimate_frf,
)

pytestmark = pytest.mark.quick

RATE = 25600.0
Tapper = Callable[..., HammeredStructure]
Pair = tuple[Channel, Channel]


@pytest.fixture
def hits(tapper: Tapper, channels: Pair) -> list[Hit]:
    source = SimulatedSource(tapper(), channels, RATE, 80_000)
    return list(capture_hits(source, Trigger(20.0, 6400, 512)))


def mean_of(hits: list[Hit]) -> RunningMean:
    mean = RunningMean()
    for hit in hits:
        mean.add(hit)
    return mean


def pulse(scale: float, noise: float = 0.0, seed: int = 0) -> Hit:
    """Make a hit on a structure that answers each force sample with `scale` times it, 3 samples later, plus noise."""
    force = np.zeros(1024)
    force[100:108] = 20, 70, 100, 80, 50, 26, 11, 4
    random = np.random.default_rng(seed).normal(scale=noise, size=1024) if noise else np.zeros(1024)
    return Hit(force, np.roll(force, 3) * scale + random, 1024.0, pre_trigger=100)


def assert_same(mean: RunningMean, hits: list[Hit]) -> None:
    expected = estimate_frf(hits)
    assert mean.frf is not None
    assert mean.frf.coherence is not None
    assert expected.coherence is not None
    assert np.allclose(mean.frf.receptance, expected.receptance, rtol=1e-12, atol=0)
    assert np.allclose(mean.frf.coherence, expected.coherence, rtol=1e-12, atol=0)
    assert (mean.frf.n_averages, mean.frf.usable_band) == (expected.n_averages, expected.usable_band)


def test_it_is_the_estimate_from_all_hits_also_after_one_was_withdrawn(hits: list[Hit]) -> None:
    mean = mean_of(hits)
    assert_same(mean, hits)
    others = [*hits[:2], *hits[3:]]
    mean.remove(hits[2])
    assert_same(mean, others)
    assert all(kept is not hits[2] for kept in mean.hits)
    mean.add(hits[2])
    assert_same(mean, hits)


def test_without_hits_there_is_nothing() -> None:
    mean = RunningMean()
    assert mean.frf is None
    assert mean.relative_change is None
    assert not mean.has_converged
    mean.add(pulse(1.0))
    assert mean.relative_change is None


def test_the_change_is_that_of_the_accelerance() -> None:
    """H = 1, 1 and 1.3: the mean of three is 1.1, 0.1 / 1.1 from the mean of two."""
    mean = mean_of([pulse(1.0), pulse(1.0)])
    assert mean.relative_change == pytest.approx(0.0, abs=1e-12)
    mean.add(pulse(1.3))
    assert mean.relative_change == pytest.approx(0.1 / 1.1, rel=1e-9)


def test_the_error_at_the_peak_is_that_of_bendat_and_piersol() -> None:
    """With H = 1 +- d in turn, g2 = 1 / (1 + d^2) at every line, and sqrt((1 - g2) / (2 n g2)) = d / sqrt(2 n)."""
    d = 0.02
    mean = mean_of([pulse(1 + d), pulse(1 - d)])
    assert mean.peak_error == np.inf
    for scale in (1 + d, 1 - d):
        mean.add(pulse(scale))
    assert mean.peak_error == pytest.approx(d / np.sqrt(8), rel=1e-6)
    assert not mean.has_converged


def test_it_settles_with_hits_that_agree_and_not_before_four() -> None:
    settled = []
    mean = RunningMean()
    for _ in range(5):
        mean.add(pulse(1.0))
        settled.append(mean.has_converged)
    assert settled == [False, False, False, True, True]


def test_noise_keeps_it_from_settling() -> None:
    errors: list[float] = []
    for noise in (1.0, 0.001):
        mean = mean_of([pulse(1.0, noise, seed) for seed in range(10)])
        errors.append(mean.peak_error)
        assert mean.has_converged == (noise < 0.1)
    assert errors[0] > 100 * errors[1]


def test_what_cannot_join_or_leave_is_rejected() -> None:
    mean = mean_of([pulse(1.0)])
    other = Hit(np.r_[pulse(1.0).force, 0.0], np.r_[pulse(1.0).acceleration, 0.0], 1024.0)
    with pytest.raises(ValueError, match=r"1025 samples at 1024 Hz .*1024 samples"):
        mean.add(other)
    with pytest.raises(ValueError, match="not in the mean"):
        mean.remove(pulse(1.0))
    silent: NDArray[np.float64] = np.zeros(1024)
    with pytest.raises(ValueError, match="pulse"):
        mean.add(Hit(silent, silent, 1024.0))
    assert len(mean.hits) == 1
