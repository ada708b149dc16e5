"""Plan of the demo: wear, scatter, and the device behind it, which is the same that others tap."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from itertools import pairwise, takewhile

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Structure, TapsSource
from dsm import natural_frequencies
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.demo import PlannedTap, plan_taps
from lobewatch.tap.emulated_spindle import (
    MountingVariation,
    SpindleWear,
    WearScenario,
    open_synchronized_device,
    set_bearing_stiffness,
)
from tests.lobewatch.tapped_emulator import make_emulator

MONTHS = 24
NOW = datetime(2025, 12, 15, 9, 30, tzinfo=UTC)
SCANS = 50_000
"""Far more than a device in step sends by itself."""


def plan(folder: MachineFolder, scatter: float, seed: int = 1) -> list[PlannedTap]:
    wear = SpindleWear.of(folder, MONTHS, WearScenario.STEADY)
    return plan_taps(folder, wear, np.random.default_rng(seed), MountingVariation(scatter), NOW)


def frequencies(taps: list[PlannedTap]) -> NDArray[np.float64]:
    """Return the true frequencies (Hz), shape (months, 2): x and y."""
    assert [tap.direction for tap in taps] == ["x", "y"] * MONTHS
    return np.reshape([tap.truth.frequency for tap in taps], (MONTHS, 2))


def test_every_month_has_a_tap_in_x_and_half_an_hour_later_one_in_y(folder: MachineFolder) -> None:
    dates = [tap.date for tap in plan(folder, 0.001)]
    assert all(earlier < later for earlier, later in pairwise(dates))
    assert [f"{date:%Y-%m-%d %H:%M}" for date in dates[:3]] == [
        *("2024-01-15 09:00", "2024-01-15 09:30"),
        "2024-02-15 09:00",
    ]
    assert dates[-1] == NOW


@pytest.mark.parametrize("months", [2, 120])
def test_the_last_month_is_the_newest_whose_tests_are_past(folder: MachineFolder, months: int) -> None:
    for now, last in ((NOW, NOW), (NOW - timedelta(seconds=1), datetime(2025, 11, 15, 9, 30, tzinfo=UTC))):
        wear = SpindleWear.of(folder, months, WearScenario.STEADY)
        dates = [tap.date for tap in plan_taps(folder, wear, np.random.default_rng(1), MountingVariation(), now)]
        assert len({(date.year, date.month) for date in dates}) == months
        assert max(dates) == last


def test_without_scatter_both_directions_fall_by_ten_percent_alike(folder: MachineFolder) -> None:
    found = frequencies(plan(folder, 0.0))
    assert found[:, 0] == pytest.approx(found[:, 1], rel=1e-12)
    assert found[-1] / found[0] == pytest.approx(0.9, rel=1e-9)
    assert np.all(np.diff(found[:, 0]) < 0)


def test_directions_differ_as_asked(folder: MachineFolder) -> None:
    wear = SpindleWear.of(folder, MONTHS, WearScenario.NONE)
    plans = plan_taps(folder, wear, np.random.default_rng(1), MountingVariation(direction_difference=2e-4), NOW)
    found = frequencies(plans)
    assert found[:, 1] / found[:, 0] - 1 == pytest.approx(np.full(MONTHS, 2e-4), rel=1e-6)


@pytest.mark.parametrize(("scatter", "seed"), [(0.001, 1), (0.001, 2), (0.005, 3)])
def test_truths_scatter_by_what_is_asked(folder: MachineFolder, scatter: float, seed: int) -> None:
    moved = frequencies(plan(folder, scatter, seed)) / frequencies(plan(folder, 0.0)) - 1
    assert np.std(moved, ddof=1) == pytest.approx(scatter, rel=0.3)  # 3 standard errors of a scatter of 48
    assert abs(np.mean(moved)) < 0.45 * scatter  # as many of their mean
    assert np.std(moved[:, 0] - moved[:, 1]) == pytest.approx(np.sqrt(2) * scatter, rel=0.45)  # each test for itself


def test_the_scatter_is_seeded(folder: MachineFolder) -> None:
    first, again, other = (frequencies(plan(folder, 0.001, seed)) for seed in (1, 1, 2))
    assert np.array_equal(first, again)
    assert np.all(first != other)


def test_the_truth_of_a_tap_is_the_spindle_whose_bearings_it_names(folder: MachineFolder) -> None:
    table = folder.machine.spindle
    assert table is not None
    for tap in plan(folder, 0.001)[::7]:
        spindle = set_bearing_stiffness(table.build(), tap.truth.bearing_stiffness)
        assert tap.truth.frequency == pytest.approx(float(natural_frequencies(spindle, 1)[0]), rel=1e-9)
        assert tap.truth.damping_ratio == table.damping_ratio
        assert (tap.structure.frequency[0], tap.structure.stiffness[0]) == (tap.truth.frequency, tap.truth.stiffness)


def test_a_device_in_step_gives_the_samples_of_one_that_runs_free(structure: Structure) -> None:
    with make_emulator(structure, np.random.default_rng(5), realtime=False) as device:
        free = codes(TapsSource(device.port))
    with open_synchronized_device(structure, np.random.default_rng(5)) as open_device:
        held = codes(open_device())
    assert np.array_equal(held, free)


def codes(source: TapsSource) -> NDArray[np.int32]:
    """Return the first codes."""
    with source:
        source.start()
        blocks = list(takewhile(lambda block: block.first_scan < SCANS, source.blocks()))
    assert not any(block.lost_before for block in blocks)
    return np.concatenate([block.codes for block in blocks], axis=1)[:, :SCANS]
