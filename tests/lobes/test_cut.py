"""Geometry and force of a cut: closed forms of the conventions (x feed, y normal, angle from +y, clockwise)."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lobes import Cut

pytestmark = pytest.mark.quick

IMMERSIONS = st.floats(0.001, 1.0)


@pytest.mark.parametrize(
    ("immersion", "direction", "entry", "leave"),
    [
        (1.0, "up", 0, 180),
        (1.0, "down", 0, 180),
        (0.5, "up", 0, 90),
        (0.5, "down", 90, 180),
        (0.25, "up", 0, 60),
        (0.25, "down", 120, 180),
    ],
)
def test_entry_exit_and_mean_angle(immersion: float, direction: Any, entry: float, leave: float) -> None:
    cut = Cut(3, immersion, direction, 600e6, 200e6)
    assert math.degrees(cut.entry_angle) == pytest.approx(entry)
    assert math.degrees(cut.exit_angle) == pytest.approx(leave)
    assert math.degrees(cut.mean_angle) == pytest.approx((entry + leave) / 2)
    assert cut.teeth_in_cut == pytest.approx(3 * (leave - entry) / 360)


def test_force_of_a_3_4_5_triangle() -> None:
    cut = Cut(2, 0.5, "up", 400e6, 300e6)
    assert cut.specific_force == pytest.approx(500e6)
    assert cut.force_angle == pytest.approx(math.atan2(4, 3))


@given(immersion=IMMERSIONS, direction=st.sampled_from(["up", "down"]), radial=st.floats(0, 2))
def test_orientation_factors_are_the_diagonal_of_the_force_matrix(
    immersion: float, direction: Any, radial: float
) -> None:
    cut = Cut(2, immersion, direction, 600e6, radial * 600e6)
    s, c = math.sin(cut.mean_angle), math.cos(cut.mean_angle)
    mu_x, mu_y = cut.orientation_factors
    assert mu_x * cut.specific_force == pytest.approx((600e6 * c + radial * 600e6 * s) * s, abs=1)
    assert mu_y * cut.specific_force == pytest.approx((-600e6 * s + radial * 600e6 * c) * c, abs=1)


@given(immersion=IMMERSIONS)
def test_up_and_down_are_mirror_images(immersion: float) -> None:
    up, down = (Cut(4, immersion, direction, 600e6, 200e6) for direction in ("up", "down"))
    assert up.entry_angle == pytest.approx(math.pi - down.exit_angle)
    assert up.mean_angle == pytest.approx(math.pi - down.mean_angle)
    assert up.teeth_in_cut == pytest.approx(down.teeth_in_cut)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"teeth": 0}, "teeth=0"),
        ({"teeth": 2.5}, "teeth=2.5"),
        ({"immersion": 0.0}, "immersion=0.0"),
        ({"immersion": 1.01}, "immersion=1.01"),
        ({"immersion": math.nan}, "immersion=nan"),
        ({"direction": "climb"}, "'climb'"),
        ({"tangential": 0.0}, "tangential=0.0 Pa"),
        ({"tangential": math.inf}, "tangential=inf Pa"),
        ({"radial": -1.0}, "radial=-1.0 Pa"),
        ({"radial": math.nan}, "radial=nan Pa"),
    ],
)
def test_what_is_no_cut_is_rejected(change: dict[str, Any], message: str) -> None:
    good = {"teeth": 4, "immersion": 0.5, "direction": "up", "tangential": 600e6, "radial": 200e6}
    with pytest.raises(ValueError, match=message):
        Cut(**{**good, **change})
