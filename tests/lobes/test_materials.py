"""Materials by name: coefficients from published specific cutting forces, their ranges, names and groups."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lobes import (
    CuttingCoefficients,
    SpecificForce,
    all_cutting_coefficients,
    explain_unknown_material,
    find_materials,
    fold_material_name,
    materials_by_name,
)

pytestmark = pytest.mark.quick

PAGE = Path(__file__).parents[2] / "docs" / "materials.md"
LISTED = [known for known in all_cutting_coefficients() if known.specific_forces]
TESTS = [known for known in all_cutting_coefficients() if not known.specific_forces]


def named(name: str) -> CuttingCoefficients:
    return materials_by_name()[fold_material_name(name)]


def test_more_than_thirty_materials_of_all_six_groups_each_with_sources() -> None:
    assert len(LISTED) >= 30
    assert {known.iso_group for known in LISTED} == set("PMKNSH")
    for known in LISTED:
        assert known.equivalents, known.material
        assert all(force.source for force in known.specific_forces), known.material
        numbers = re.findall(r"(kc1\.1 \d+, mc 0\.\d\d|Kt \d+|Kr/Kt): \S", known.source)
        assert len(numbers) >= len(known.specific_forces) + 1, known.material


def test_no_name_means_two_materials() -> None:
    names = [fold_material_name(name) for known in all_cutting_coefficients() for name in known.names]
    assert len(names) == len(set(names))


@pytest.mark.parametrize(
    ("name", "equivalents"),
    [
        ("C45", ("1.0503", "AISI 1045")),
        ("42CrMo4", ("1.7225", "AISI 4140", "UNS G41400")),
        ("X5CrNi18-10", ("1.4301", "AISI 304")),
        ("EN-GJL-250", ("GG-25", "gg25")),
        ("EN AW-7075", ("3.4365", "AlZnMgCu1.5")),
        ("TiAl6V4", ("3.7165", "Ti-6Al-4V", "ti6al4v")),
        ("NiCr19Fe19Nb5Mo3", ("2.4668", "Inconel 718")),
        ("X40CrMoV5-1 hardened", ("1.2344 hardened",)),
    ],
)
def test_equivalents_are_one_material(name: str, equivalents: tuple[str, ...]) -> None:
    assert {named(equivalent).material for equivalent in equivalents} == {name}


@pytest.mark.parametrize(
    ("name", "forces"),
    [
        ("C45", [(1500, 0.22), (1600, 0.25), (2220, 0.14)]),
        ("42CrMo4", [(1725, 0.24), (1900, 0.25), (2500, 0.26)]),
        ("X5CrNi18-10", [(2150, 0.20)]),
        ("EN-GJL-250", [(1150, 0.20), (1100, 0.28), (1160, 0.26)]),
        ("TiAl6V4", [(2110, 0.22), (1245, 0.24), (1400, 0.23)]),
    ],
)
def test_specific_forces_are_those_published(name: str, forces: list[tuple[float, float]]) -> None:
    assert [(round(force.at_1_mm / 1e6), force.exponent) for force in named(name).specific_forces] == forces


def test_kt_of_c45_by_hand() -> None:
    slopes = [0.78 * 1500 * 0.1**-0.22, 0.75 * 1600 * 0.1**-0.25, 0.86 * 2220 * 0.1**-0.14]
    assert named("C45").tangential == pytest.approx(np.mean(slopes) * 1e6)
    low, high = named("C45").tangential_range or (0, 0)
    assert low == pytest.approx(0.78 * 1500 * 0.2**-0.22 * 1e6)
    assert high == pytest.approx(0.86 * 2220 * 0.05**-0.14 * 1e6)
    assert named("C45").radial == pytest.approx(0.27 * named("C45").tangential)


def test_one_source_is_taken_to_be_off_by_a_quarter() -> None:
    steel = named("AISI 304")
    assert len(steel.specific_forces) == 1
    assert np.array(steel.tangential_range) / steel.tangential == pytest.approx([0.75, 1.25])


@given(
    st.floats(100e6, 5000e6, allow_nan=False),
    st.floats(0.05, 0.45, allow_nan=False),
    st.floats(2e-5, 5e-4, allow_nan=False),
)
def test_kt_is_the_slope_of_the_force_and_kte_what_is_left(at_1_mm: float, exponent: float, chip: float) -> None:
    law = SpecificForce(at_1_mm, exponent, "")

    def force(thickness: float) -> float:
        return at_1_mm * float((thickness * 1e3) ** -exponent) * thickness

    step = 1e-4 * chip
    slope = (force(chip + step) - force(chip - step)) / (2 * step)
    assert law.tangential(chip) == pytest.approx(slope, rel=1e-5)
    assert law.tangential(chip) * chip + law.tangential_edge(chip) == pytest.approx(force(chip), rel=1e-9)


def test_every_range_holds_its_middle_and_all_that_is_published() -> None:
    for known in LISTED:
        assert known.tangential_range is not None
        assert known.ratio_range is not None
        low, high = known.tangential_range
        assert low <= 0.75 * known.tangential < 1.25 * known.tangential <= high, known.material
        published = [law.tangential(chip) for law in known.specific_forces for chip in (0.5e-4, 1e-4, 2e-4)]
        published += [test.tangential for test in TESTS if known.alloy and test.alloy == known.alloy]
        assert low <= min(published) <= max(published) <= high, known.material
        assert known.ratio_range[0] < known.radial / known.tangential < known.ratio_range[1], known.material


def test_the_ratio_of_aluminium_is_that_of_the_milling_tests() -> None:
    ratios = [test.radial / test.tangential for test in TESTS if test.iso_group == "N"]
    aluminium = named("EN AW-7075")
    assert len(ratios) == 8
    assert aluminium.ratio_range == pytest.approx((min(ratios), max(ratios)), abs=0.01)
    assert aluminium.radial / aluminium.tangential == pytest.approx(np.median(ratios), abs=0.005)


def test_the_ratio_of_titanium_is_that_of_its_orthogonal_data() -> None:
    ratio = np.tan(np.radians(19.1 + 0.29 * 5 - 5))
    titanium = named("TiAl6V4")
    assert titanium.radial / titanium.tangential == pytest.approx(ratio, abs=0.005)


def test_tests_of_one_alloy_have_their_spread_and_a_single_one_has_none() -> None:
    assert named("Al 7075 (HSS; dry)").tangential_range == pytest.approx((600.46e6, 1319.41e6))
    assert named("Steel (textbook)").tangential_range is None


def test_materials_are_found_by_a_part_of_a_name_or_by_their_group() -> None:
    assert {known.material for known in find_materials("4140")} == {"42CrMo4"}
    assert {known.material for known in find_materials(" al 7075")} == {
        test.material for test in TESTS if test.alloy == "Al 7075"
    }
    assert {known.iso_group for known in find_materials("s")} == {"S"}
    assert len(find_materials("")) == len(all_cutting_coefficients())
    with pytest.raises(ValueError, match=r"'Inconell 718'.*'Inconel 718'"):
        find_materials("Inconell 718")


def test_the_page_holds_what_the_tables_hold() -> None:
    rows = [line.strip("| \n").split(" | ") for line in PAGE.read_text("utf-8").splitlines() if line.startswith("| ")]
    shown = [row for row in rows if len(row) == 7 and row[1] in set("PMKNSH")]
    assert shown == [as_row(known) for known in LISTED]
    assert [a[1] for a, b in pairwise(shown) if a[1] != b[1]] == list("PMKNS")


def as_row(known: CuttingCoefficients) -> list[str]:
    low, high = (round(limit / 1e6) for limit in known.tangential_range or (0, 0))
    least, most = known.ratio_range or (0, 0)
    laws = ", ".join(f"{force.at_1_mm / 1e6:.0f}/{force.exponent:.2f}" for force in known.specific_forces)
    return [
        known.material,
        known.iso_group,
        ", ".join(known.equivalents),
        laws,
        f"{known.tangential / 1e6:.0f} ({low}..{high})",
        f"{known.radial / known.tangential:.2f} ({least:.2f}..{most:.2f})",
        f"{known.tangential_edge / 1e3:.0f}",
    ]


@pytest.mark.parametrize(("short", "name"), [("6061", "AA 6061"), ("4140", "AISI 4140"), ("316L", "AISI 316L")])
def test_the_number_of_a_standard_names_a_material(short: str, name: str) -> None:
    assert named(short) is named(name)


@pytest.mark.parametrize(("group", "name"), [("steel", "42CrMo4"), ("Titanium", "TiAl6V4"), ("aluminum", "EN AW-7075")])
def test_a_group_of_materials_is_answered_with_their_names(group: str, name: str) -> None:
    assert name in explain_unknown_material(group, materials_by_name())
