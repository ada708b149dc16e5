"""A record shorter than the decay: the resulting bias, and error bounds that hold."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Frf, from_accelerance
from modal import Mode, Trust, assess_trust, fit_modes
from modal.quality.assess_mode import with_truncation_error

DAMPING, STIFFNESS, RATE = 0.02, 3.5e7, 25600.0


def cut_off(frequency: float, left: float, late: float = 0.0, zeros: int = 0, noise: float = 2e-4) -> Frf:
    """Return the accelerance of a mode after an impulse whose record ends with the share `left` of it.

    The impulse is `late` of the record after its start; zeros for `zeros` times its length are appended. The transform
    is
    integrated in closed form.
    """
    w = 2 * np.pi * frequency
    pole = w * (-DAMPING + 1j * np.sqrt(1 - DAMPING**2))
    residue = w**2 / STIFFNESS / (2j * pole.imag)
    size = round(-np.log(left) / (DAMPING * w) / (1 - late) * RATE)
    lines = np.arange(size * (1 + zeros) // 2) * RATE / (size * (1 + zeros))
    s, rings = 2j * np.pi * lines, size / RATE * (1 - late)
    exact = np.zeros(lines.size, complex)
    for p, r in ((pole, residue), (np.conj(pole), np.conj(residue))):
        exact += p * r + p**2 * r * (1 - np.exp((p - s) * rings)) / (s - p)
    used = (lines > 200) & (lines < 4000)
    random = np.random.default_rng(round(frequency)).normal(size=(2, np.sum(used)))
    return from_accelerance(
        lines[used], exact[used] + noise * np.max(np.abs(exact[used])) * (random[0] + 1j * random[1])
    )


def fitted(frequency: float, *case: float) -> Mode:
    left, late, zeros = case
    return min(fit_modes(cut_off(frequency, left, late, int(zeros))), key=lambda mode: abs(mode.frequency - frequency))


def off(mode: Mode, frequency: float) -> NDArray[np.float64]:
    """From the truth, as shares of the half-width, of zeta and of K."""
    return np.array(
        [
            (mode.frequency - frequency) / (DAMPING * frequency),
            mode.damping_ratio / DAMPING - 1,
            mode.stiffness / STIFFNESS - 1,
        ]
    )


FREQUENCIES = [1500.0 + 7 * k for k in range(12)]


@pytest.mark.parametrize("left", [0.01, 0.03, 0.045])
def test_on_the_lines_of_the_record_stiffness_alone_is_off_by_what_is_left(left: float) -> None:
    """1 - exp(lambda T): its phase goes through more than a turn from 1500 to 1577 Hz."""
    shares = np.array([off(fitted(frequency, left, 0.0, 0), frequency) for frequency in FREQUENCIES])
    assert np.max(np.abs(shares[:, :2])) < 0.15 * left
    assert 0.5 * left < np.max(np.abs(shares[:, 2])) < 1.2 * left


@pytest.mark.parametrize("case", [(0.01, 0.0, 0), (0.03, 0.0, 0), (0.045, 0.0, 0), (0.03, 0.05, 0), (0.02, 0.0, 1)])
def test_the_intervals_hold_it_and_the_mode_is_trusted(case: tuple[float, ...]) -> None:
    modes = [fitted(frequency, *case) for frequency in FREQUENCIES]
    for mode, frequency in zip(modes, FREQUENCIES, strict=True):
        reach = mode.quantile() * mode.standard_error / np.array([DAMPING * frequency, DAMPING, STIFFNESS])
        assert np.all(np.abs(off(mode, frequency)) < reach)
        assert abs(mode.phase_deg) < mode.quantile() * mode.phase_deg_std
        assert assess_trust(mode) is Trust.TRUSTED


def test_what_is_left_is_reported_where_it_makes_the_error_of_stiffness() -> None:
    said = [
        "still-ringing" in [remark.code for remark in fitted(1500.0, left, 0.0, 0).remarks] for left in (1e-3, 0.01)
    ]
    assert said == [False, True]


def test_more_than_the_errors_stand_for_is_doubtful() -> None:
    assert assess_trust(fitted(1500.0, 0.07, 0.0, 0)) is Trust.DOUBTFUL


def test_errors_stand_for_no_more() -> None:
    mode = Mode(1500.0, DAMPING, STIFFNESS, np.diag([0.1, 1e-5, 1e4]) ** 2, remaining_decay=0.051)
    assert with_truncation_error(mode) is mode


def test_values_that_are_held_stay_without_error() -> None:
    mode = Mode(1500.0, DAMPING, STIFFNESS, np.diag([0.0, 0.0, 1e4]) ** 2, remaining_decay=0.04)
    widened = with_truncation_error(mode).standard_error
    assert widened[:2].tolist() == [0.0, 0.0]
    assert widened[2] == pytest.approx(0.04 * STIFFNESS / np.sqrt(2), rel=1e-3)
