"""Growth of samples with process damping in a cut of constant force."""

from __future__ import annotations

import numpy as np

from lobes import Cut, build_milling_system, rows_at_speeds, stability_boundary
from lobewatch.verdicts.program_samples import ProgramSamples
from lobewatch.verdicts.uncertainty import FactorRange, Uncertainty
from modal import Mode

NOTHING = Uncertainty({}, np.zeros((0, 4, 4)), 0.0, FactorRange(1, 1), FactorRange(1, 1))


def test_growth_of_a_damped_slot_changes_its_sign_at_the_limit() -> None:
    x, y = [Mode(1713.0, 0.03, 3.5e7)], [Mode(1690.0, 0.03, 3.5e7)]
    cut, speeds = Cut(4, 1.0, "down", 1.4e9, 5e8, process_damping=1e7), np.array([900.0, 1500.0])
    limits = stability_boundary(x, y, cut, speeds, 0.03).depth
    samples = ProgramSamples(
        rows_at_speeds(build_milling_system(x, y), cut, speeds), (cut,), np.full(1, np.inf), 1, NOTHING
    )
    assert np.all(np.isfinite(limits))
    grown = samples.growth(limits[:, np.newaxis] * [0.2, 0.999, 1.001, 3.0])
    assert (grown >= 0).tolist() == [[False, False, True, True]] * 2
    assert np.all(np.isfinite(grown))
