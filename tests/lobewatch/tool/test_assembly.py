"""Tool assembled from tap tests, and the reasons for unknown directions."""

from __future__ import annotations

import re
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
    ("code", "reason"), [("no-lobes-driving-point", "driving point"), ("no-modes", "no mode in the band")]
)
def test_a_direction_that_was_tapped_in_vain_is_not_reported_to_be_untapped(code: str, reason: str) -> None:
    tool = with_x(measurement("x", code=code))
    assert tool.directions == ("y",)
    gap, cure = tool.missing_direction
    assert re.search(f"direction x.*{reason}", gap)
    assert re.search(r"\bx\b", cure)
    (remark,) = [remark for remark in tool.remarks if remark.code == "one-direction"]
    assert re.search(rf"\bx\b.*{reason}", remark.text)
    assert remark.cure == cure


def test_a_direction_that_was_not_tapped_is_reported_to_be_so() -> None:
    gap, cure = with_x().missing_direction
    assert "direction x" in gap
    assert "direction x" in cure
