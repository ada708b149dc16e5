"""Origin of spectral peaks, on synthetic spectra."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from lobewatch.cuts.chatter_detection.peak_classification import PeaksByOrigin, classify_peaks, is_in_air
from lobewatch.cuts.chatter_detection.spectrum import SpectralPeaks, Spectrum
from lobewatch.cuts.chatter_detection.tooth_passing_comb import SpindleSpeed

pytestmark = pytest.mark.quick

Floats = NDArray[np.float64]
RATE, BIN, TURN, TEETH = 25600.0, 1.0, 200.0, 4
TURNING = SpindleSpeed(TURN, 1e-4, 1.0, 9, 0.0)


def quiet(power: float = 1e-6) -> Spectrum:
    """Return one second without a peak."""
    frequency: Floats = np.linspace(0.0, RATE / 2, round(RATE) + 1)
    noise = np.full(frequency.size, power)
    return Spectrum(frequency, noise.copy(), noise, BIN, RATE)


def lines(*pairs: tuple[float, float], clearness: float = 1e4) -> SpectralPeaks:
    """Lines (Hz, m/s^2)."""
    frequency, amplitude = np.array(pairs).T
    return SpectralPeaks(frequency, amplitude, np.full(frequency.size, clearness))


def ordered(*pairs: tuple[float, float], turning: SpindleSpeed = TURNING, unsteady: float = 0.0) -> PeaksByOrigin:
    return classify_peaks(lines(*pairs), quiet(), quiet(), turning, TEETH, unsteady)


def test_multiples_are_those_of_the_spindle_by_their_teeth_but_for_its_own_line() -> None:
    by_origin = ordered((200.0, 9.0), (400.0, 1.0), (800.0, 5.0), (1000.0, 1.0), (1712.0, 3.0), (2400.0, 2.0))
    assert by_origin.comb.frequency.tolist() == [400.0, 800.0, 1000.0, 2400.0]
    assert by_origin.tooth_order.tolist() == [2, 0, 1, 0]
    assert by_origin.unexplained.frequency.tolist() == [1712.0]
    assert len(by_origin.air) == 0


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize(
    ("error", "unsteady", "reach"),
    [(0.0, 0.0, 1.2), (0.1, 0.0, 1.2 + 10 * 3 * 0.1), (0.0, 1e-3, 1.2 + 10 * 0.2), (0.1, 1e-3, 1.2 + 10 * 0.5)],
)
def test_a_multiple_is_within_1_2_bins_and_what_its_speed_leaves_open(
    side: int, error: float, unsteady: float, reach: float
) -> None:
    turning = SpindleSpeed(TURN, error, 1.0, 9, 0.0)
    for share, count in ((0.98, 2), (1.02, 1)):
        line = 2000.0 + side * share * reach
        assert len(ordered((1600.0, 1.0), (line, 1.0), turning=turning, unsteady=unsteady).comb) == count


@pytest.mark.parametrize(("times", "is_there"), [(8.8, True), (9.2, False)])
def test_a_line_is_foreign_with_less_than_nine_times_its_power_in_air(times: float, is_there: bool) -> None:
    air = quiet()
    air.power[2000] = 4.0
    for off in (-2.0, 0.0, 2.0):
        line = lines((1000.0 + off, np.sqrt(times * 4.0)))
        assert is_in_air(line, air).tolist() == [is_there]
    beside = lines((1003.5, np.sqrt(times * 4.0)), (996.5, np.sqrt(times * 4.0)))
    assert not np.any(is_in_air(beside, air))
    by_origin = classify_peaks(
        lines((1000.0, 2.0), (1031.0, 2.0)), quiet(), air, SpindleSpeed(77.7, 0.0, 1, 9, 0), 4, 0.0
    )
    assert by_origin.air.frequency.tolist() == [1000.0]
    assert by_origin.unexplained.frequency.tolist() == [1031.0]


def folded(order: int, turn: float) -> float:
    """Fold a harmonic above half the sample rate."""
    return abs(order * turn - RATE * round(order * turn / RATE))


@pytest.mark.parametrize(("order", "off", "loud", "is_left"), [
    (70, 0.0, 1.4, False), (70, 1.1, 1.4, False), (70, -1.1, 1.4, False), (70, 1.3, 1.4, True), (70, -1.3, 1.4, True),
    (70, 0.0, 1.6, True), (120, 0.0, 1.4, False), (250, 0.0, 1.4, False), (255, 0.0, 1.4, True),
])  # fmt: skip
def test_a_multiple_above_half_the_sample_rate_is_no_chatter_where_it_is_folded_to(
    order: int, off: float, loud: float, is_left: bool
) -> None:
    """Up to two sample rates, and 1.5 times as loud at most as the loudest multiple above 0.7 of half of one."""
    turn = 201.37
    turning = SpindleSpeed(turn, 1e-6, 1.0, 9, 0.0)
    upper = 45 * turn, 1.0
    assert upper[0] > 0.7 * RATE / 2 > 44 * turn
    line = folded(order, turn) + off, loud
    by_origin = classify_peaks(lines((44 * turn, 9.0), upper, line), quiet(), quiet(), turning, TEETH, 0.0)
    assert by_origin.unexplained.frequency.tolist() == ([line[0]] if is_left else [])


def test_without_multiples_high_up_nothing_is_taken_for_folded() -> None:
    turn = 201.37
    line = folded(70, turn), 0.1
    by_origin = classify_peaks(
        lines((44 * turn, 9.0), line), quiet(), quiet(), SpindleSpeed(turn, 1e-6, 1, 9, 0), 4, 0.0
    )
    assert by_origin.unexplained.frequency.tolist() == [line[0]]
