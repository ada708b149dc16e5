"""Published cutting speeds and feeds per tooth: which rows count, their ranges, and the page that shows them."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from lobes import (
    TOOL_MATERIALS,
    CuttingCoefficients,
    PublishedRange,
    classify_cut,
    fold_material_name,
    materials_by_name,
    published_cutting_speed,
    published_feed_per_tooth,
    published_speed_of_any_tool,
)
from lobes.materials import read_table

pytestmark = pytest.mark.quick

PAGE = Path(__file__).parents[2] / "docs" / "tools.md"
GROUPS = {
    "P": "42CrMo4",
    "M": "1.4301",
    "K": "EN-GJL-250",
    "N": "EN AW-6082",
    "S: Ni, Fe": "Inconel 718",
    "S: Ti": "TiAl6V4",
    "H": "100Cr6 hardened",
}
"""Groups as the page has them, by a material of each."""
DIAMETERS = (0.006, 0.012, 0.020)


def named(name: str) -> CuttingCoefficients:
    return materials_by_name()[fold_material_name(name)]


def m_min(speed: PublishedRange | None) -> tuple[float, float] | None:
    return None if speed is None else (speed.low * 60, speed.high * 60)


def test_each_row_is_a_range_with_its_source() -> None:
    for name, low, high in (
        ("cutting_speeds.csv", "low_m_per_min", "high_m_per_min"),
        ("feeds_per_tooth.csv", "low", "high"),
    ):
        for row in read_table(name):
            assert 0 < float(row[low]) <= float(row[high]), row
            assert {*row["tool_material"].split(";")} <= {*TOOL_MATERIALS}, row
            assert row["cut"] in ("slot", "side"), row
            assert len(row["source"]) > 20, row


def test_the_range_covers_all_sources_of_the_group() -> None:
    speed = published_cutting_speed(named("42CrMo4"), "coated carbide", "side")
    assert m_min(speed) == pytest.approx((70, 300))
    assert speed is not None
    assert len(speed.sources) == 4


def test_one_number_is_taken_to_be_off_by_a_quarter() -> None:
    assert m_min(published_cutting_speed(named("EN-GJL-250"), "carbide", "slot")) == pytest.approx(
        (0.75 * 57, 1.25 * 57)
    )


def test_titanium_and_nickel_are_of_one_group_and_cut_at_different_speeds() -> None:
    titanium, nickel = (
        m_min(published_cutting_speed(named(name), "coated carbide", "side")) for name in ("TiAl6V4", "2.4668")
    )
    assert titanium == pytest.approx((40, 90))
    assert nickel == pytest.approx((18, 45))


def test_what_nobody_publishes_is_not_known() -> None:
    assert published_cutting_speed(named("42CrMo4"), "PCD", "side") is None
    assert published_cutting_speed(named("100Cr6 hardened"), "HSS", "slot") is None
    assert published_cutting_speed(CuttingCoefficients("mine", 2e9, 5e8), "carbide", "slot") is None
    assert published_feed_per_tooth(CuttingCoefficients("mine", 2e9, 5e8), "carbide", "slot", 0.01) is None


def test_no_tool_is_faster_than_the_fastest() -> None:
    for name in GROUPS.values():
        for cut in ("slot", "side"):
            fastest = published_speed_of_any_tool(named(name), cut)
            assert fastest is not None
            speeds = [published_cutting_speed(named(name), tool, cut) for tool in TOOL_MATERIALS]
            assert max(speed.high for speed in speeds if speed) == fastest.high
            assert fastest.low == 0.0


def test_a_feed_is_on_a_line_between_the_diameters_of_a_source_and_on_one_to_zero_below_them() -> None:
    steel = named("42CrMo4")

    def feed(diameter: float) -> tuple[float, float]:
        known = published_feed_per_tooth(steel, "coated carbide", "slot", diameter)
        assert known is not None
        return known.low * 1e3, known.high * 1e3

    assert feed(0.006) == pytest.approx((0.025, 0.055))
    assert feed(0.009) == pytest.approx(((0.025 + 0.035) / 2, (0.055 + 0.07) / 2))
    assert feed(0.003) == pytest.approx((0.0125, 0.0275))
    assert feed(0.050) == pytest.approx(feed(0.020))


def test_a_feed_published_as_a_share_of_the_diameter_grows_with_it() -> None:
    nickel = named("2.4668")
    for diameter in DIAMETERS:
        feed = published_feed_per_tooth(nickel, "coated carbide", "side", diameter)
        assert feed is not None
        assert (feed.low, feed.high) == pytest.approx((0.002 * diameter, 0.004 * diameter))


def test_a_cut_from_two_fifths_of_the_diameter_on_is_a_slot() -> None:
    assert [classify_cut(immersion) for immersion in (0.05, 0.39, 0.4, 1.0)] == ["side", "side", "slot", "slot"]


def test_the_page_holds_what_the_tables_hold() -> None:
    lines = PAGE.read_text("utf-8").splitlines()
    rows = [line.strip("| ").split(" | ") for line in lines if line.startswith("| ")]
    assert [row for row in rows if len(row) == 7 and row[2] in ("slot", "side")] == list(page_rows())
    names = {
        row["source"].split(": ")[0]
        for table in ("cutting_speeds.csv", "feeds_per_tooth.csv")
        for row in read_table(table)
    }
    assert {row[0] for row in rows if len(row) == 2} >= names


def page_rows() -> list[list[str]]:
    """Return the published ranges, a row for each group, tool material and kind of cut."""
    rows = []
    for group, name in GROUPS.items():
        for tool in TOOL_MATERIALS:
            for cut in ("slot", "side"):
                speed = m_min(published_cutting_speed(named(name), tool, cut))
                feeds = [published_feed_per_tooth(named(name), tool, cut, diameter) for diameter in DIAMETERS]
                if speed:
                    shown = ["-" if feed is None else f"{feed.low * 1e3:.3f}..{feed.high * 1e3:.3f}" for feed in feeds]
                    rows.append([group, tool, cut, f"{rounded(speed[0])}..{rounded(speed[1])}", *shown])
    return rows


def rounded(speed: float) -> str:
    return f"{math.floor(speed + 0.5):d}"
