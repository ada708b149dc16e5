"""Records that were filled up with zeros, seen in their FRF."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Frf, estimate_frf, from_accelerance, infer_recorded_share
from modal import Mode, Trust, assess_trust, fit_modes, synthesize_frf
from tests.modal.test_hit_scatter import tap

RATE = 12800.0


def filled_up(left: float, times: int, noise: float = 0.002, seed: int = 0) -> Frf:
    """Return the FRF of a truncated and zero-padded impulse response.

    `left` is the remaining share of the mode at 1500 Hz, `times` the padding over the record length.
    """
    size = int(-np.log(left) / (2 * np.pi * 1500 * 0.005) * RATE)
    time = np.arange(size) / RATE
    response = np.zeros(size)
    for frequency, stiffness in ((800.0, 5e7), (1500.0, 3e7)):
        w = 2 * np.pi * frequency
        response += w / stiffness * np.exp(-0.005 * w * time) * np.sin(w * time)
    lines = np.fft.rfftfreq(times * size, 1 / RATE)
    kept = (lines > 5) & (lines < 3200)

    def spectrum(signal: NDArray[np.float64]) -> NDArray[np.complex128]:
        return np.asarray(np.fft.rfft(signal, times * size)[kept])

    exact = -((2 * np.pi * lines[kept]) ** 2) * spectrum(response) / RATE
    white = spectrum(np.random.default_rng(seed).normal(size=size))
    return from_accelerance(lines[kept], exact + noise * np.max(np.abs(exact)) * white / np.sqrt(size))


@pytest.mark.parametrize("times", [2, 4])
@pytest.mark.parametrize("left", [0.001, 0.01, 0.03])
def test_zeros_behind_a_record_are_seen(left: float, times: int) -> None:
    shares = [infer_recorded_share(filled_up(left, times, seed=seed)) for seed in range(5)]
    assert shares == pytest.approx([1 / times] * 5, abs=0.03)


def test_whole_records_have_none() -> None:
    assert {infer_recorded_share(filled_up(left, 1)) for left in (0.001, 0.01, 0.03, 0.1)} == {1.0}
    assert {infer_recorded_share(estimate_frf(tap(seed, hits))) for seed in range(10) for hits in (1, 10)} == {1.0}
    exact = synthesize_frf([Mode(900.0, 0.02, 4e7), Mode(1722.0, 0.03, 3.5e7)], np.arange(5.0, 4000.0, 5.0))
    assert infer_recorded_share(exact) == 1.0
    assert infer_recorded_share(Frf(np.geomspace(10, 3000, 799), exact.receptance)) == 1.0


def test_what_rings_at_the_end_of_the_true_record_is_reported() -> None:
    mode = min(fit_modes(filled_up(0.1, 4)), key=lambda mode: abs(mode.frequency - 1500))
    assert mode.remaining_decay == pytest.approx(0.1, rel=0.3)
    assert assess_trust(mode) is Trust.DOUBTFUL
    assert "still-ringing" in [remark.code for remark in mode.remarks]
