"""Numbers with a unit: conversion to the unit of the key, in machine.toml and in options, and rejected texts."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition import DataError
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.machine.settings.unit_text import FEED_UNITS, LENGTH_UNITS, POWER_UNITS, SPEED_UNITS, read_quantity
from tests.lobewatch.commands.invoke import invoke

pytestmark = pytest.mark.quick

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
INCH = """
[machine]
name = "m"

[tap]
stick_out_mm = "3 in"

[reference_cut]
teeth = 4
tool_diameter_mm = "1/2in"
radial_depth_mm = ["0.1 in", '0.25"']
feed_per_tooth_mm = "0.002 ipt"
direction = "down"
material = "6061"
"""


@pytest.mark.parametrize(
    ("text", "units", "value"),
    [
        ("0.5in", LENGTH_UNITS, 12.7),
        ('1/2"', LENGTH_UNITS, 12.7),
        ("1-1/2 IN", LENGTH_UNITS, 38.1),
        ("2 thou", LENGTH_UNITS, 0.0508),
        ("0.3 in", LENGTH_UNITS, 7.62),
        ("12,5 mm", LENGTH_UNITS, 12.5),
        ("1.250 in", LENGTH_UNITS, 31.75),
        ("0.002 ipt", FEED_UNITS, 0.0508),
        ("300 sfm", SPEED_UNITS, 91.44),
        ("1000 ft/min", SPEED_UNITS, 304.8),
        ("10 hp", POWER_UNITS, 7.45699872),
        ("1400 W", POWER_UNITS, 1.4),
    ],
)
def test_a_number_with_a_unit_is_converted(text: str, units: dict[str, float], value: float) -> None:
    assert read_quantity(text, units) == value


@given(st.integers(1, 99999))
def test_an_inch_has_exactly_as_many_millimetres_as_written(thousandths: int) -> None:
    assert read_quantity(f"{thousandths / 1000} in", LENGTH_UNITS) == float(f"{thousandths * 0.0254:.10g}")


@pytest.mark.parametrize(
    "text", ["0.5 im", "0.5 sfm", "in", "1,234 in", "half an inch", "1/0 in", "0.5 0.6 in", "-1 in"]
)
def test_other_texts_are_rejected_with_their_value(text: str) -> None:
    with pytest.raises(ValueError, match=f"'.*{text.split()[0][-3:]}"):
        read_quantity(text, LENGTH_UNITS)


def test_machine_toml_takes_texts_with_units() -> None:
    cut = parse_machine_file(INCH).reference_cut
    assert cut is not None
    assert (cut.tool_diameter_mm, cut.radial_mm, cut.feed_per_tooth_mm) == (12.7, (2.54, 6.35), 0.0508)
    with pytest.raises(DataError, match=r"tool_diameter_mm.*'im'"):
        parse_machine_file(INCH.replace("1/2in", "1/2im"))


def test_options_take_texts_with_units(shop: Shop) -> None:
    shop.tap_both()
    words = ["check", str(shop.path), "--speed", "12900", "--tool", "reference", "--json", "--depth"]
    inch, metric = (json.loads(invoke([*words, depth]).stdout)["programs"] for depth in ("0.05in", "1.27"))
    assert inch == metric
    assert inch[0]["depth_mm"] == 1.27
    for depth, fact in (("0.05 im", "'im'"), ("1/8", "1/8in")):
        rejected = invoke([*words, depth])
        assert (rejected.exit_code, fact in rejected.stderr) == (2, True)
