"""Measured peaks that the modes used for lobes do not explain, by closed forms and invariances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition import Frf
from modal import Mode, find_unexplained_peaks, synthesize_frf
from modal.quality.unexplained_peaks import HIGHEST_TOOTH_FREQUENCY, MAX_UNEXPLAINED_SHARE, MIN_LIMITING_SHARE

pytestmark = pytest.mark.quick

LINES = np.arange(2.0, 3000.0, 2.0)
STRONG, OTHER = Mode(900.0, 0.02, 2e7), Mode(1700.0, 0.03, 3e7)


def least_real_part(mode: Mode) -> float:
    """Return the most negative real part of a real mode alone (m/N)."""
    return -1 / (4 * mode.stiffness * mode.damping_ratio * (1 + mode.damping_ratio))


def frf_of(*modes: Mode, noise: float = 0.0, seed: int = 0) -> Frf:
    """Return their FRF with complex noise of an rms (m/N)."""
    parts = np.random.default_rng(seed).normal(scale=noise / np.sqrt(2), size=(2, LINES.size))
    return Frf(LINES, synthesize_frf(modes, LINES).receptance + parts[0] + 1j * parts[1])


@pytest.mark.parametrize(("used", "missing"), [((STRONG,), OTHER), ((OTHER,), STRONG)])
def test_a_mode_that_is_not_used_leaves_its_peak_with_the_real_part_in_closed_form(
    used: tuple[Mode, ...], missing: Mode
) -> None:
    (peak,) = find_unexplained_peaks(frf_of(STRONG, OTHER), used)
    beside = float(used[0].receptance(np.array([missing.frequency])).real[0])
    assert peak.frequency == pytest.approx(missing.frequency, rel=0.01)
    assert peak.measured == pytest.approx(least_real_part(missing) + beside, rel=0.03)
    assert least_real_part(peak.missing) == pytest.approx(least_real_part(missing), rel=0.03)
    assert peak.missing.frequency == pytest.approx(missing.frequency, rel=0.01)


@pytest.mark.parametrize("used", [(), (STRONG,), (STRONG, OTHER), (replace(STRONG, stiffness=6e7), OTHER)])
def test_with_the_modes_that_are_missing_the_measurement_is_covered(used: tuple[Mode, ...]) -> None:
    frf = frf_of(STRONG, OTHER)
    found = find_unexplained_peaks(frf, used)
    assert bool(found) == (used != (STRONG, OTHER))
    assert find_unexplained_peaks(frf, [*used, *(peak.missing for peak in found)]) == ()


@pytest.mark.parametrize(("factor", "is_found"), [(1 - MAX_UNEXPLAINED_SHARE / 2, False), (0.7, True), (1.5, False)])
def test_only_modes_that_are_too_stiff_leave_something(factor: float, is_found: bool) -> None:
    used = replace(STRONG, stiffness=STRONG.stiffness / factor)
    assert bool(find_unexplained_peaks(frf_of(STRONG), [used])) is is_found


@pytest.mark.parametrize(("share", "is_found"), [(0.7 * MIN_LIMITING_SHARE, False), (1.4 * MIN_LIMITING_SHARE, True)])
def test_a_peak_counts_from_a_share_of_the_deepest(share: float, is_found: bool) -> None:
    small = Mode(2300.0, 0.02, STRONG.stiffness / share)
    frf = frf_of(STRONG, small)
    beside = STRONG.receptance(np.array([small.frequency])).real[0]
    lifted = Frf(LINES, frf.receptance - beside * (LINES > 2000))
    assert bool(find_unexplained_peaks(lifted, [STRONG])) is is_found


@pytest.mark.parametrize(("error", "is_within"), [(0.02, False), (0.3, True)])
def test_the_errors_of_the_modes_explain_what_lies_within_them(error: float, is_within: bool) -> None:
    used = replace(STRONG, stiffness=STRONG.stiffness * 1.4)
    errors = np.array([0.1, 1e-4, error * used.stiffness])
    (peak,) = find_unexplained_peaks(frf_of(STRONG), [replace(used, covariance=np.diag(errors**2))])
    assert peak.is_within_errors is is_within
    assert peak.explained == pytest.approx(least_real_part(used), rel=0.03)


@pytest.mark.parametrize("seed", range(5))
def test_noise_leaves_nothing(seed: int) -> None:
    noise = 0.1 * abs(least_real_part(OTHER))
    assert find_unexplained_peaks(frf_of(STRONG, OTHER, noise=noise, seed=seed), [STRONG, OTHER]) == ()


@pytest.mark.parametrize(
    ("low", "is_found"),
    [
        (Mode(20.0, 0.02, 2e4), False),  # a suspension, softer than any machine
        (Mode(40.0, 0.05, 2e7), False),  # a foundation of 300 kg
        (Mode(300.0, 0.03, 3e7), True),
    ],
)
def test_below_the_modes_only_what_belongs_to_the_tool_counts(low: Mode, is_found: bool) -> None:
    found = find_unexplained_peaks(frf_of(low, STRONG, OTHER), [STRONG, OTHER])
    assert [peak.frequency for peak in found] == pytest.approx([low.frequency] * is_found, rel=0.02)


def test_hits_that_disagree_hide_no_peak() -> None:
    frf = replace(frf_of(STRONG, OTHER), coherence=np.where(LINES < 1300, 0.1, 1.0), n_averages=10)
    assert [round(peak.frequency, -2) for peak in find_unexplained_peaks(frf, [OTHER])] == [900.0]


@given(st.floats(0.1, 10.0))
def test_a_softer_machine_has_the_same_peaks(factor: float) -> None:
    def scaled(mode: Mode) -> Mode:
        return replace(mode, stiffness=mode.stiffness * factor)

    (peak,) = find_unexplained_peaks(frf_of(STRONG, OTHER), [OTHER])
    (same,) = find_unexplained_peaks(frf_of(scaled(STRONG), scaled(OTHER)), [scaled(OTHER)])
    assert same[:3] == pytest.approx((peak.frequency, peak.measured / factor, peak.explained / factor), rel=1e-6)


@pytest.mark.parametrize(("band", "found"), [(None, [1100.0]), ((1300.0, 2500.0), [1100.0, 1700.0])])
def test_a_peak_in_the_band_is_compared_with_peaks_in_the_band(
    band: tuple[float, float] | None, found: list[float]
) -> None:
    peaks = find_unexplained_peaks(frf_of(Mode(1100.0, 0.003, 8e6), OTHER), [], band)
    assert [peak.frequency for peak in peaks] == pytest.approx(found, rel=0.03)


def test_a_deep_peak_hides_no_peak_far_above_it() -> None:
    deep, tip = Mode(30.0, 0.04, 1.2e6), Mode(1500.0, 0.02, 3.5e7)
    assert least_real_part(tip) > MIN_LIMITING_SHARE * least_real_part(deep)
    found = find_unexplained_peaks(frf_of(deep, tip), [deep])
    assert [peak.frequency for peak in found] == pytest.approx([tip.frequency], rel=0.01)


def test_far_above_a_deep_peak_its_flank_hides_what_limits_less() -> None:
    deep = Mode(30.0, 0.04, 1.2e6)
    flank = abs(deep.receptance(np.array([HIGHEST_TOOTH_FREQUENCY / 2])).real[0])
    for share, is_found in ((0.5, False), (2.0, True)):
        weak = Mode(1600.0, 0.02, 1 / (4 * 0.02 * 1.02 * share * flank))
        assert bool(find_unexplained_peaks(frf_of(deep, weak), [deep])) is is_found


@pytest.mark.parametrize("half_widths", [0.1, 0.3, 0.5])
def test_an_uncertain_frequency_deepens_no_peak(half_widths: float) -> None:
    used = replace(STRONG, stiffness=1.5 * STRONG.stiffness)
    errors = np.array([half_widths * used.frequency * used.damping_ratio, 1e-4, 0.01 * used.stiffness])
    (peak,) = find_unexplained_peaks(frf_of(STRONG), [replace(used, covariance=np.diag(errors**2))])
    assert not peak.is_within_errors


def test_the_missing_mode_has_the_relative_errors_of_the_nearest_mode() -> None:
    errors = {STRONG: np.array([1.0, 2e-3, 1e6]), OTHER: np.array([2.0, 1e-3, 4e6])}
    used = [replace(mode, covariance=np.diag(error**2), phase_deg_std=2.0) for mode, error in errors.items()]
    (peak,) = find_unexplained_peaks(frf_of(*used, Mode(2400.0, 0.02, 3e7)), used)
    missing = peak.missing
    relative = missing.standard_error / [missing.frequency, missing.damping_ratio, missing.stiffness]
    assert relative == pytest.approx([2 / 1700, 1e-3 / 0.03, 4e6 / 3e7])
    assert missing.phase_deg_std == 2.0


@pytest.mark.parametrize("count", [2, 7])
def test_too_few_lines_are_an_error(count: int) -> None:
    frf = frf_of(STRONG)
    with pytest.raises(ValueError, match=f"^{count} lines"):
        find_unexplained_peaks(Frf(frf.frequency[:count], frf.receptance[:count]), [])
