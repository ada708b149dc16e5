"""Programs called stable and settings recommended, with all frequencies 0 to 7 % lower; see docs/studies/lobes.md."""

from __future__ import annotations

import sys

import milling_simulation
import numpy as np
import pytest
from at_speed_study import DROPS, chance_truths, draw_machine, drop_modes, study


def test_the_drop_of_the_truth_keeps_modal_mass_and_damping() -> None:
    modes = draw_machine(np.random.default_rng(1)).x
    for (f, zeta, k), (lower, same, softer) in zip(modes, drop_modes(modes, 0.05), strict=True):
        assert (lower / f, same, softer / lower**2) == pytest.approx((0.95, zeta, k / f**2))


def test_a_few_settings_and_programs_hold_at_speed() -> None:
    counts = study(range(2), seed=1, most_modes=1, n_programs=1)
    assert counts.settings
    assert counts.count(counts.settings) == [0, 0, 0, 0]


@pytest.mark.long
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("most_modes", [1, 3])
def test_at_most_2_percent_of_settings_and_1_percent_of_stable_programs_chatter_5_percent_lower(
    most_modes: int,
) -> None:
    counts = study(range(120), seed=20 + most_modes, most_modes=most_modes)
    settings, programs = (np.array(counts.count(part)) for part in (counts.settings, counts.programs))
    sys.stdout.write(f"{len(counts.settings)} settings {settings}, {len(counts.programs)} programs {programs}, {DROPS}")
    assert np.all(settings <= np.array([0.01, 0.01, 0.02, 0.05]) * len(counts.settings))
    assert np.all(programs <= np.array([0.01, 0.01, 0.01, 0.03]) * len(counts.programs))


@pytest.mark.long
@pytest.mark.timeout(7200)
def test_the_chance_of_chatter_is_what_truths_as_assumed_do() -> None:
    """Stated for the setting, counted on eight truths of each machine."""
    counts = study(range(60), seed=30, n_programs=0)
    stated, counted, total = 0.0, 0, 0
    for outcome in counts.settings:
        rng = np.random.default_rng((30, outcome.number))
        truths = chance_truths(draw_machine(rng), outcome, 8, rng)
        counted += int(np.sum(milling_simulation.chatters(truths)))
        total += len(truths)
        stated += outcome.risk * len(truths)
    sys.stdout.write(f"stated {stated:.1f}, counted {counted} of {total}")
    assert 0.5 * stated - 3 <= counted <= 2 * stated + 3
