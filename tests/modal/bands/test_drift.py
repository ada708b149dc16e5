"""Drift is never a mode to follow, and hides none."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition import Frf, Remark
from modal import Mode, fit_modes, predominant_mode, select_credible_modes, synthesize_frf

TRUE, OTHER = Mode(1500.0, 0.03, 3e7), Mode(2600.0, 0.03, 8e7)


def drifting(random: np.random.Generator) -> Frf:
    """Return one or two modes with noise and a drift of 2e-4 to 2 m/N x (1 Hz/f)^2 of random phase.

    Half of the drifts are behind a high-pass filter of 0.3 to 3 Hz and first or second order.
    """
    f = np.arange(1.0, 4000.0, 1.0) * random.choice([0.5, 1.0, 5.0])
    f = f[f <= 4000.0]
    drift = 10 ** random.uniform(np.log10(2e-4), np.log10(2)) / f**2 * np.exp(2j * np.pi * random.uniform())
    if random.uniform() < 0.5:
        drift = drift * (1j * f / (1j * f + 10 ** random.uniform(-0.5, 0.5))) ** random.integers(1, 3)
    noise = 1e-3 * np.abs(TRUE.receptance(np.array([1500.0]))) * random.standard_normal((2, f.size))
    modes = [TRUE, OTHER][: random.integers(1, 3)]
    return Frf(f, synthesize_frf(modes, f).receptance + drift + noise[0] + 1j * noise[1])


def followed(count: int, seed: int) -> tuple[int, list[Mode]]:
    """Return how often the true mode is followed, and the modes followed instead."""
    random, right, wrong = np.random.default_rng(seed), 0, list[Mode]()
    for _ in range(count):
        mode = predominant_mode(select_credible_modes(fit_modes(drifting(random))).modes)
        if mode is not None:
            is_true = abs(mode.frequency / 1500 - 1) < 5e-3 and abs(mode.stiffness / 3e7 - 1) < 0.05
            right, wrong = right + is_true, [*wrong, *([] if is_true else [mode])]
    return right, wrong


def test_the_true_mode_is_followed_next_to_drift() -> None:
    right, wrong = followed(20, 3)
    assert wrong == []
    assert right == 20


@pytest.mark.long
def test_no_wrong_mode_in_300_drifts() -> None:
    right, wrong = followed(300, 1)
    assert wrong == []
    assert right >= 290


def test_a_drift_against_the_phase_of_a_mode_does_not_hide_it() -> None:
    f = np.arange(1.0, 4000.0)
    (mode,) = fit_modes(Frf(f, TRUE.receptance(f) + 1.2 / f**2 * np.exp(0.87j)))
    assert (mode.frequency, mode.stiffness) == pytest.approx((1500.0, 3e7), rel=1e-6)


@pytest.mark.parametrize(
    ("mode", "code", "facts"),
    [
        (Mode(1.09, 0.74, 3e6), "mode-not-believed", ("74 %", "drift")),
        (Mode(1.09, 0.02, 19.7), "stiffness-not-believed", ("20 N/m", "0.1 to 10000 N/um")),
        (Mode(9e2, 0.02, -2e10), "stiffness-not-believed", ("-20000 N/um",)),
        (Mode(3990.0, 0.03, 3e7, remarks=(Remark("cut-by-edge", "", "x"),)), "mode-not-believed", ("3 %", "edge")),
        (Mode(900.0, 0.03, 3e7, np.diag([1.0, 1e-3, 2e7]) ** 2), "mode-not-believed", ("3 %", "stiffness")),
    ],
)
def test_what_is_not_believed_is_reported_with_its_reason(mode: Mode, code: str, facts: tuple[str, ...]) -> None:
    found = select_credible_modes([mode, TRUE, Mode(1900.0, 0.01, -3e7)])
    assert [one.frequency for one in found.modes] == [1500.0]
    assert [one.frequency for one in found.opposed] == [1900.0]
    (remark,) = found.remarks
    assert (remark.code, remark.about) == (code, f"{mode.frequency:.4g} Hz")
    assert all(fact in remark.text for fact in facts)
