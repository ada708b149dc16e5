"""Zero-order approximation of many spindles, against lobes.zero_order and semi-discretization."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lobes import Cut, build_milling_system, project_modes, rows_at_speeds, zero_order_lobes
from lobes.floquet import count_pieces, largest_multipliers
from lobewatch.cuts.chatter_detection.spectrum import fold_frequency
from lobewatch.verdicts.zero_order_batch import ZeroOrderBatch, is_force_constant
from modal import Mode

pytestmark = pytest.mark.quick

X = [Mode(1713.0, 0.029, 3.5e7), Mode(2400.0, 0.02, 9e7, phase_deg=20.0)]
Y = [Mode(1400.0, 0.035, 2.5e7)]
SPEEDS = np.geomspace(4000, 24000, 60)


@pytest.mark.parametrize("angle", [0.0, 0.7])
@pytest.mark.parametrize(
    "cut",
    [
        Cut(4, 1.0, "down", 1.4e9, 5e8),
        Cut(3, 0.5, "up", 7e8, 1e8),
        Cut(4, 0.75, "down", 1.4e9, 5e8, pitch=tuple(np.radians((80, 90, 95, 95)))),
    ],
)
def test_limits_are_those_of_zero_order(cut: Cut, angle: float) -> None:
    cut = replace(cut, feed_angle=angle)
    rows = rows_at_speeds(build_milling_system(X, Y), cut, np.ones(2))
    rows.tangential[1] *= 2
    rows.radial[1] *= 2
    depth, chatter = ZeroOrderBatch.of(rows).limits(SPEEDS)
    wanted = zero_order_lobes(X, Y, cut, SPEEDS)
    assert depth[0] == pytest.approx(wanted.depth, rel=0.02)
    assert chatter[0] == pytest.approx(wanted.chatter_frequency, rel=2e-3)
    assert depth[1] == pytest.approx(depth[0] / 2)


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_limits_of_rotated_modes_are_those_of_zero_order(angle: float) -> None:
    cut, vectors = Cut(3, 0.5, "up", 7e8, 1e8, feed_angle=angle), [[0.8, 0.6], [0.3, 0.95], [-0.6, 0.8]]
    rows = rows_at_speeds(build_milling_system(X, Y, vectors), cut, np.ones(1))
    shown = project_modes([*X, *Y], vectors)
    wanted = zero_order_lobes(shown.x, shown.y, cut, SPEEDS, shown.cross)
    depth, chatter = ZeroOrderBatch.of(rows).limits(SPEEDS)
    assert depth[0] == pytest.approx(wanted.depth, rel=0.02)
    assert chatter[0] == pytest.approx(wanted.chatter_frequency, rel=2e-3)


@pytest.mark.parametrize("vectors", [None, [[0.8, 0.6], [0.3, 0.95], [-0.6, 0.8]]])
def test_growth_and_frequency_beyond_the_limit_are_those_of_semi_discretisation(
    vectors: list[list[float]] | None,
) -> None:
    cut = Cut(4, 1.0, "down", 1.4e9, 5e8)
    rows = rows_at_speeds(build_milling_system(X, Y, vectors), cut, SPEEDS)
    depth = 3e-3
    multiplier = largest_multipliers(rows, np.full((60, 1), depth), count_pieces(rows, depth))[:, 0]
    grown, frequency = ZeroOrderBatch.of(rows).fastest_growth(SPEEDS, depth)
    teeth = 1 / rows.tooth_period
    far = np.abs(multiplier) > 1.02
    assert np.sum(far) > 40
    assert (grown / teeth)[far] == pytest.approx(np.log(np.abs(multiplier[far])), abs=2e-3)
    base = np.abs(np.angle(multiplier)) / (2 * np.pi) * teeth
    assert fold_frequency(frequency, teeth)[far] == pytest.approx(base[far], abs=0.5)


def test_the_force_of_a_slot_with_four_teeth_is_constant_and_that_of_three_or_of_half_a_slot_is_not() -> None:
    kinds = ((4, 1.0), (6, 1.0), (3, 1.0), (4, 0.5))
    assert [is_force_constant(Cut(teeth, share, "up", 7e8, 2e8)) for teeth, share in kinds] == [
        True,
        True,
        False,
        False,
    ]


@pytest.mark.parametrize("vectors", [None, [[0.8, 0.6], [0.3, 0.95], [-0.6, 0.8]]])
@pytest.mark.parametrize("cut", [Cut(4, 1.0, "down", 1.4e9, 5e8), Cut(3, 0.25, "up", 2e9, 6e8, feed_angle=0.7)])
def test_estimates_with_process_damping_are_close_to_the_limits(cut: Cut, vectors: list[list[float]] | None) -> None:
    """Lobes 8 to 40, spindles with and without process damping, limits up to ten times as deep."""
    draw, speeds = np.random.default_rng(5), np.geomspace(700.0, 2600.0, 10)
    rows = rows_at_speeds(
        build_milling_system([replace(mode, phase_deg=0.0) for mode in X], Y, vectors), cut, np.ones(30)
    )
    rows.frequency[:] *= draw.uniform(0.9, 1.05, rows.frequency.shape)
    rows = replace(rows, process_damping=np.maximum(draw.uniform(-1e7, 4e7, 30), 0.0))
    batch, damped = ZeroOrderBatch.of(rows), rows.process_damping > 0
    limits, estimates = batch.limits(speeds, 0.02)[0], batch.estimate_limits(speeds, 0.02)[0]
    assert np.array_equal(estimates[~damped], limits[~damped])
    error = np.abs(np.log(estimates[damped] / np.minimum(limits[damped], 0.02)))
    assert np.quantile(error, 0.8) < 0.015
    assert np.quantile(error, 0.98) < 0.05
    assert np.max(limits[damped]) > 5 * np.max(limits[~damped])
