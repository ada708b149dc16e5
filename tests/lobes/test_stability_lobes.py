"""The result type of all stability methods."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lobes import StabilityLobes

INF, NAN = np.inf, np.nan


def chart(**change: Any) -> StabilityLobes:
    values: dict[str, Any] = {
        "speed_rpm": np.array([4000.0, 1000.0, 2000.0, 3000.0]),
        "depth": np.array([INF, 1e-3, 3e-3, 2e-3]),
        "chatter_frequency": np.array([NAN, 510.0, 520.0, 530.0]),
        "kind": np.array(["", "hopf", "hopf", "flip"]),
        "crossings": np.array([[INF, INF], [1e-3, INF], [3e-3, INF], [2e-3, 4e-3]]),
        "method": "by hand",
    }
    return StabilityLobes(**{**values, **change})


def test_depth_between_speeds_is_linear_and_takes_the_finite_neighbour() -> None:
    wanted = [1000, 1500, 1750, 2000, 2500, 3000, 3001, 3999, 4000]
    np.testing.assert_allclose(
        chart().depth_at(wanted), [1e-3, 2e-3, 2.5e-3, 3e-3, 2.5e-3, 2e-3, 2e-3, 2e-3, INF], rtol=1e-12
    )
    assert float(chart().depth_at(1500)) == pytest.approx(2e-3)


@pytest.mark.parametrize("speed", [999.0, 4001.0, NAN])
def test_depth_outside_the_chart_is_rejected(speed: float) -> None:
    with pytest.raises(ValueError, match=rf"{speed:g} rpm .*1000\.\.4000 rpm"):
        chart().depth_at([2000.0, speed])


def test_minimum_is_the_lowest_point() -> None:
    assert chart().minimum == (1e-3, 1000.0, 510.0)


def test_cuts_below_the_limit_are_stable() -> None:
    assert chart().is_stable([1500, 1500, 2000, 4000], [1.9e-3, 2.1e-3, 3e-3, 1.0]).tolist() == [
        True,
        False,
        False,
        True,
    ]
    with pytest.raises(ValueError, match="depth=nan"):
        chart().is_stable(1500, NAN)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"depth": np.array([1e-3, NAN, 1e-3, 1e-3])}, "depth\\[1\\]=nan m .*> 0"),
        ({"depth": np.array([1e-3, 1e-3, 0.0, 1e-3])}, "depth\\[2\\]=0.0 m"),
        ({"depth": np.ones(3)}, r"depth .*\(3,\)"),
        ({"kind": np.array(["hopf"])}, r"kind .*\(1,\)"),
        ({"crossings": np.ones(4)}, r"crossings .*\(4,\)"),
        ({"speed_rpm": np.array([1.0, 2.0, 3.0, 0.0])}, "speed_rpm\\[3\\]=0.0"),
    ],
)
def test_what_is_no_chart_is_rejected(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        chart(**change)
