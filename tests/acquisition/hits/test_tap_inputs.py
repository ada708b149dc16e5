"""Which inputs of a device a tap test reads."""

from __future__ import annotations

import numpy as np

from acquisition import Channel
from acquisition.hit import TapInputs

HAMMER = Channel("force", 1e-2, 5.0)
X, Y = (Channel("acceleration", 1e-2, 5.0, direction=name) for name in ("x", "y"))
ALONG_THE_SPINDLE = Channel("acceleration", 1e-2, 5.0)
DEVICE = (X, HAMMER, ALONG_THE_SPINDLE, Y)


def test_a_hammer_in_x_is_felt_across_by_a_sensor_along_y() -> None:
    assert TapInputs.select(DEVICE, "force", "x").rows == (1, 3, 0)
    for direction in ("y", "xy"):
        assert TapInputs.select(DEVICE, "force", direction).rows == (1, 3)
    assert TapInputs.select((HAMMER, Y), "force", "x").rows == (0, 1)  # there is no other
    assert TapInputs.select((X, Y), "acceleration", "x").rows == (0,)  # nothing without a force


def test_each_sensor_has_its_own_codes_and_overload() -> None:
    inputs = TapInputs.select(DEVICE, "force", "x")
    codes = np.arange(30, dtype=np.int32).reshape(3, 10)  # force, y, x
    hit = inputs.make_hit(codes, 1000.0, 2, 1, overload=0b011)
    assert hit.cross_hit is not None
    assert (hit.channels, hit.cross_hit.channels, hit.sensors) == ((HAMMER, X), (HAMMER, Y), (HAMMER, Y, X))
    assert (hit.overload, hit.cross_hit.overload) == (0b01, 0b11)
    assert (hit.lost_scans, hit.cross_hit.lost_scans, hit.cross_hit.pre_trigger) == (1, 1, 2)
    np.testing.assert_array_equal(hit.codes, codes[[0, 2]])
    np.testing.assert_array_equal(hit.cross_hit.codes, codes[[0, 1]])
    alone = TapInputs.select((X,), "acceleration", "x").make_hit(codes[:1], 1000.0, overload=1)
    assert (alone.overload, alone.cross_hit, alone.sensors) == (0b10, None, (X,))
