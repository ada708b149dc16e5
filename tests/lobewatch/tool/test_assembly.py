"""Tool assembled from tap tests, and the reasons for unknown directions."""

from __future__ import annotations

from datetime import UTC, datetime

import pytest

from acquisition import Remark
from lobewatch.measurement.tap_measurement import Measurement
from lobewatch.tool.assembly import Assembly, assemble
from modal import Mode

TIME = datetime(2026, 1, 1, tzinfo=UTC)


def measurement(direction: str, *modes: Mode, code: str = "") -> Measurement:
    remarks = (Remark(code, "", "no stability lobes"),) if code else ()
    return Measurement(f"tap in {direction}", TIME, "T", direction, modes, at_tip=modes, remarks=remarks)


def with_x(x: Measurement | None = None) -> Assembly:
    return assemble(measurement("y", Mode(1700.0, 0.03, 2e7)), x, {"x": [], "y": []})


@pytest.mark.parametrize(
    ("code", "gap"),
    [
        (
            "no-lobes-driving-point",
            (
                "direction x is tapped, not usable: not a driving point",
                "hit and measure at one point in x and tap again",
            ),
        ),
        ("no-modes", ("direction x is tapped, not usable: no mode in the band", "tap x again")),
    ],
)
def test_a_direction_that_was_tapped_in_vain_is_not_reported_to_be_untapped(code: str, gap: tuple[str, str]) -> None:
    tool = with_x(measurement("x", code=code))
    assert tool.directions == ("y",)
    assert tool.missing_direction == gap
    (remark,) = [remark for remark in tool.remarks if remark.code == "one-direction"]
    assert remark.text == f"modes in the y direction alone, x taken like y; {gap[0].removeprefix('direction ')}"
    assert remark.cure == gap[1]


def test_a_direction_that_was_not_tapped_is_reported_to_be_so() -> None:
    assert with_x().missing_direction == ("direction x was not tapped", "tap direction x of tool 'T' too")
