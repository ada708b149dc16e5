"""Verdicts on hits without a measured force."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Hit, HitFlags, check_hit, evaluate_hit, read_hits
from acquisition.hit_quality.double_hit import find_second_input
from acquisition.hits.free_decay import extract_free_decay
from lobewatch.tap.emulated_spindle import EMULATED_SAMPLE_RATE
from tests.modal.test_hit_scatter import PRE_TRIGGER, RECORD, STRUCTURE

WIDTH = 0.65e-3


def response(seed: int, touches: tuple[tuple[float, float], ...] = (), noise: float = 2.0) -> NDArray[np.float64]:
    """Acceleration of a hit of 250 N; touches: delay (s) and share of each further one."""
    time = (np.arange(RECORD) - PRE_TRIGGER) / EMULATED_SAMPLE_RATE
    signal = np.random.default_rng(seed).normal(scale=noise, size=RECORD)
    for delay, share in ((0.0, 1.0), *touches):
        after = time >= delay
        signal[after] += 250 * share * STRUCTURE.response(time[after] - delay, WIDTH)
    return signal


def hit_of(signal: NDArray[np.float64]) -> Hit:
    return Hit(np.empty(0), signal, EMULATED_SAMPLE_RATE, PRE_TRIGGER)


def test_good_hits_are_good() -> None:
    assert [check_hit(hit_of(response(seed))) for seed in range(40)] == [HitFlags.OK] * 40


@pytest.mark.parametrize("share", [0.1, 0.4])
@pytest.mark.parametrize("delay", [5e-3, 8e-3, 25e-3])
def test_a_double_hit_is_reported_and_when_it_came(delay: float, share: float) -> None:
    for seed in range(3):
        verdict = evaluate_hit(hit_of(response(seed, ((delay, share),))))
        assert verdict.flags == HitFlags.DOUBLE_HIT
        assert float(verdict.text.split(" ms after")[0].split()[-1]) == pytest.approx(1e3 * delay, abs=1.5)


def test_a_real_decay_that_is_not_linear_is_no_double_hit() -> None:
    for name in ("acceleration", "camera"):
        (hit,) = read_hits(f"tests/data/ladisk_beam/{name}.lvm")
        alone = Hit(np.empty(0), hit.acceleration, hit.sample_rate, 30)
        noise = float(np.std(hit.acceleration[:24]))
        assert find_second_input(extract_free_decay(alone), hit.sample_rate, noise) is None


def test_faults_of_the_response_are_reported() -> None:
    clipped = np.clip(response(1), -400, 400)
    assert check_hit(hit_of(clipped)) == HitFlags.OVERLOAD_RESPONSE
    assert check_hit(hit_of(0.01 * response(1, noise=0.0) + noise_alone())) == HitFlags.TOO_SOFT
    assert check_hit(hit_of(noise_alone())) == HitFlags.TOO_SOFT
    assert check_hit(Hit(np.empty(0), response(3)[: PRE_TRIGGER + 200], EMULATED_SAMPLE_RATE, PRE_TRIGGER)) == (
        HitFlags.NOT_DECAYED
    )
    lost = Hit(np.empty(0), response(4), EMULATED_SAMPLE_RATE, PRE_TRIGGER, lost_scans=3)
    assert check_hit(lost) == HitFlags.LOST_SCANS


def noise_alone() -> NDArray[np.float64]:
    return np.random.default_rng(9).normal(scale=2.0, size=RECORD)


def test_a_decay_begins_after_the_hit_and_swings_about_rest() -> None:
    at_rest = extract_free_decay(hit_of(response(5) + 9.81))
    assert at_rest.size == RECORD - PRE_TRIGGER - round(1.5e-3 * EMULATED_SAMPLE_RATE)
    assert np.mean(at_rest[-1000:]) == pytest.approx(0.0, abs=0.3)
    unknown = Hit(np.empty(0), response(5) + 9.81, EMULATED_SAMPLE_RATE)
    assert abs(extract_free_decay(unknown).size - at_rest.size) < 20
