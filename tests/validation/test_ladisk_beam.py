"""A real hammer hit on a beam, response and force at different points.

ladisk/ImageBasedModalAnalysisTutorial, see SOURCE.txt beside the recording. Modes known from it: 695.8, 1898.0, 3671
and 5975 Hz with damping ratios 0.0047, 0.0031, 0.0019 and 0.0044, the last two of negative constant.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from acquisition import Frf, estimate_frf, read_hits
from modal import ConjugateError, Mode, fit_modes, pick_peaks

RECORDING = Path(__file__).parents[1] / "data" / "ladisk_beam" / "acceleration.lvm"
FREQUENCY = [695.8, 1898.0, 3671.0, 5975.0]
DAMPING = [0.0047, 0.0031, 0.0019, 0.0044]


@pytest.fixture(scope="module")
def beam() -> Frf:
    return estimate_frf(read_hits(RECORDING))


def nearest(modes: list[Mode], frequency: float) -> Mode:
    return min(modes, key=lambda mode: abs(mode.frequency - frequency))


def test_known_modes_are_fitted(beam: Frf) -> None:
    found = [nearest(fit_modes(beam), f) for f in FREQUENCY]
    assert [mode.frequency for mode in found] == pytest.approx(FREQUENCY, rel=5e-4)
    assert [mode.damping_ratio for mode in found] == pytest.approx(DAMPING, rel=0.09)
    assert [mode.is_driving_point for mode in found] == [True, True, False, False]


def test_known_modes_are_picked(beam: Frf) -> None:
    found = [nearest(pick_peaks(beam), f) for f in FREQUENCY]
    assert [mode.frequency for mode in found] == pytest.approx(FREQUENCY, rel=5e-4)
    assert [mode.damping_ratio for mode in found] == pytest.approx(DAMPING, rel=0.1)
    assert [mode.is_driving_point for mode in found] == [True, True, False, False]


def test_list_is_short_enough_to_read(beam: Frf) -> None:
    assert len(fit_modes(beam)) < 10
    assert len(fit_modes(beam, (300.0, 6500.0))) == 5


def test_conjugate_is_rejected(beam: Frf) -> None:
    with pytest.raises(ConjugateError):
        fit_modes(Frf(beam.frequency, beam.receptance.conj(), measured_as="accelerance", usable_band=beam.usable_band))
