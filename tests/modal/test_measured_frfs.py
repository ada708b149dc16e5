"""Effects of measured FRFs beyond white noise: overloads, echoes, joints."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Frf, from_accelerance
from modal import Mode, Trust, assess_trust, fit_modes, synthesize_frf, trust_rules

LINES = np.arange(1.0, 1601.0) / 8
"""8 s of record."""
WING = [Mode(18.85, 0.008, 3e5), Mode(40.16, 0.006, 1.5e6), Mode(97.1, 0.005, 7e6), Mode(143.4, 0.01, 9e6)]
EXACT = synthesize_frf(WING, LINES).accelerance


def averaged(hits: NDArray[np.complex128]) -> Frf:
    """H1 of hits of equal force with a coherence, without a hit count."""
    mean = hits.mean(axis=0)
    coherence = np.abs(mean) ** 2 / np.mean(np.abs(hits) ** 2, axis=0)
    return from_accelerance(LINES, mean, coherence)


def overloaded(seed: int) -> NDArray[np.complex128]:
    """Five hits, each with a jump of the sensor in its first quarter of a second that differs from hit to hit."""
    random = np.random.default_rng(seed)
    hits = []
    for _ in range(5):
        time, jump = random.uniform(0, 0.25, 40), random.normal(size=40)
        spurious = jump @ np.exp(-2j * np.pi * time[:, np.newaxis] * LINES)
        hits.append(EXACT + 1e-2 * np.median(np.abs(EXACT)) * spurious)
    return np.array(hits)


def is_true(mode: Mode) -> bool:
    return any(abs(mode.frequency - true.frequency) < 4 * true.damping_ratio * true.frequency for true in WING)


def test_what_differs_from_hit_to_hit_but_not_from_line_to_line_makes_no_modes() -> None:
    found = [mode for seed in range(8) for mode in fit_modes(averaged(overloaded(seed)))]
    false = [mode for mode in found if not is_true(mode)]
    assert len(found) - len(false) == 8 * len(WING)
    assert false == []


@pytest.mark.parametrize(("weaker", "verdict"), [(10.0, Trust.TRUSTED), (30.0, Trust.DOUBTFUL)])
def test_a_small_peak_on_the_flank_of_a_far_stronger_one_is_doubtful(weaker: float, verdict: Trust) -> None:
    """A second blow, a drift of the joint or a time window make such peaks about a sharp one."""
    modes = [Mode(40.16, 0.002, 1.5e6), Mode(41.26, 0.002, 1.5e6 * weaker)]
    exact, noise = synthesize_frf(modes, LINES).accelerance, np.random.default_rng(1).normal(size=(2, LINES.size))
    found = fit_modes(from_accelerance(LINES, exact + 1e-4 * np.max(np.abs(exact)) * (noise[0] + 1j * noise[1])))
    assert "bent-by-neighbour" not in dict(trust_rules(found[0]))
    assert ("bent-by-neighbour" in dict(trust_rules(found[1]))) == (verdict is Trust.DOUBTFUL)


def with_echo(noise: float) -> Mode:
    """Return a mode with a ripple from an echo of 2 %, which is alike over many lines and may hide a shift."""
    echo = 1 + 0.02 * np.exp(-2j * np.pi * 0.35 * LINES)
    exact, random = synthesize_frf([Mode(97.1, 0.02, 7e6)], LINES).accelerance * echo, np.random.default_rng(1)
    off = random.normal(size=(2, LINES.size)) * noise * np.max(np.abs(exact))
    (mode,) = fit_modes(from_accelerance(LINES, exact + off[0] + 1j * off[1]))
    return mode


def over_left(mode: Mode) -> NDArray[np.float64]:
    """Its standard errors as shares of half-width, zeta and K, over the share of its peak that the fit leaves."""
    assert mode.misfit_share is not None
    scale = np.array([mode.damping_ratio * mode.frequency, mode.damping_ratio, mode.stiffness])
    return np.asarray(mode.standard_error / scale / mode.misfit_share)


def test_what_is_left_about_a_mode_is_in_its_errors() -> None:
    mode = with_echo(1e-4)
    assert mode.misfit is not None
    assert mode.misfit > 4
    least = np.array([2.5, 2.5, 4.0]) * np.sqrt(1 - (2 / mode.misfit) ** 2)
    assert np.all(over_left(mode) > least)
    assert assess_trust(mode) is Trust.TRUSTED


def test_it_comes_into_them_without_a_step() -> None:
    misfits, errors = zip(
        *((m.misfit, over_left(m)[1]) for m in map(with_echo, np.geomspace(1e-3, 6e-3, 25))), strict=True
    )
    near = (np.array(misfits) > 1.8) & (np.array(misfits) < 2.2)
    assert np.min(misfits) < 1.9
    assert np.max(misfits) > 2.1
    assert np.ptp(np.array(errors)[near]) < 1.0
