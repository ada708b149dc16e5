"""Lobes of stated modes: units, rejected texts, and pockets that are stable without a machine folder."""

from __future__ import annotations

import json

import numpy as np
import pytest

from lobes import Cut, fold_material_name, materials_by_name, stability_boundary, zero_order_lobes
from lobewatch.logbook.stated_modes import parse_mode
from modal import Mode
from tests.lobewatch.commands.conftest import Run
from tests.lobewatch.commands.invoke import invoke

MODES = ["--mode", "600 Hz 3% 10 N/um", "--mode-y", "650 Hz 3% 12 N/um"]
CUT = ["--teeth", "4", "--material", "6061", "--speeds", "6,000 12,000"]


@pytest.mark.parametrize(
    "text", ["600 Hz 3% 10 N/um", "600Hz, zeta=3%, 1e7 N/m", "0.6 kHz 0.03 10 kN/mm", "600 hz 3 % 10000 N/mm"]
)
def test_a_mode_may_be_written_in_several_units(text: str) -> None:
    mode = parse_mode(text)
    assert (mode.frequency, mode.damping_ratio, mode.stiffness) == pytest.approx((600.0, 0.03, 1e7), rel=1e-12)


@pytest.mark.parametrize(
    ("text", "fact"),
    [
        ("600 3% 10 N/um", "600 3% 10 N/um"),
        ("600 Hz 3 10 N/um", "3 %"),
        ("600 Hz 0.3 10 N/um", "30 %"),
        ("600 Hz -3% 10 N/um", "-0.03"),
        ("600 Hz 3% 10", "no unit"),
        ("600 Hz 3% 10 kN", "'kN'"),
        ("600 Hz 3% 10 mN/m", "'mN/m'"),
        ("60000 Hz 3% 10 N/um", "60000 Hz"),
        ("600 Hz 3% 10 N/m", "10 N/m"),
    ],
)
def test_other_modes_are_rejected_with_their_value(text: str, fact: str) -> None:
    with pytest.raises(ValueError, match="600") as error:
        parse_mode(text)
    assert fact in str(error.value)


def test_pockets_of_stated_modes_are_below_the_limit_of_the_semi_discretisation() -> None:
    answer = json.loads(invoke(["lobes", *MODES, *CUT, "--json"]).stdout)
    material = materials_by_name()[fold_material_name("EN AW-6061")]
    cut = Cut(4, 1.0, "down", material.tangential, material.radial)
    x, y = [Mode(600.0, 0.03, 1e7)], [Mode(650.0, 0.03, 1.2e7)]
    speeds = np.linspace(6000.0, 12000.0, len(answer["speed_rpm"]))
    assert answer["minimum_depth_mm"] == pytest.approx(zero_order_lobes(x, y, cut, speeds).minimum.depth * 1e3)
    assert answer["pockets"]
    for pocket in answer["pockets"]:
        (limit,) = stability_boundary(x, y, cut, pocket["speed_rpm"], 20e-3).depth
        assert 1e3 * limit == pytest.approx(pocket["depth_mm"] * (1 + pocket["depth_margin"]), rel=0.02)
    assert {"modes-stated", "diameter-assumed"} <= {remark["code"] for remark in answer["remarks"]}


def test_the_radial_depth_of_a_stated_cut_counts() -> None:
    def lowest(*size: str) -> float:
        return float(json.loads(invoke(["lobes", *MODES, *CUT, *size, "--json"]).stdout)["minimum_depth_mm"])

    slot, thin = lowest("--diameter", "20"), lowest("--diameter", "20", "--radial-depth", "4")
    material = materials_by_name()[fold_material_name("EN AW-6061")]
    cut = Cut(4, 0.2, "down", material.tangential, material.radial)
    x, y = [Mode(600.0, 0.03, 1e7)], [Mode(650.0, 0.03, 1.2e7)]
    speeds = np.linspace(6000.0, 12000.0, 400)
    feeds = [zero_order_lobes(*modes, cut, speeds).minimum.depth for modes in ((x, y), (y, x))]
    assert thin == pytest.approx(1e3 * min(feeds), rel=0.002)
    assert thin != pytest.approx(slot, rel=0.1)


@pytest.mark.parametrize(("depth", "verdict"), [("0.2", "stable"), ("5", "not stable")])
def test_a_setting_on_stated_modes_has_a_verdict(depth: str, verdict: str) -> None:
    answer = json.loads(invoke(["lobes", *MODES, *CUT, "--speed", "8600", "--depth", depth, "--json"]).stdout)
    assert [program["verdict"] for program in answer["programs"]] == [verdict]


@pytest.mark.parametrize(
    ("words", "facts"),
    [
        ([], ["--mode"]),
        (MODES[:2], ["--teeth", "--material"]),
        ([*MODES, *CUT, "--speed", "8600"], ["--depth"]),
        ([*MODES, *CUT, "--tool", "T"], ["--tool"]),
        ([*MODES, *CUT, "--radial-depth", "1"], ["--radial-depth 1", "--diameter"]),
        ([*MODES, "--teeth", "4", "--material", "steel"], ["'steel'", "42CrMo4"]),
        (["m", "--teeth", "4"], ["--teeth"]),
    ],
)
def test_one_error_for_options_that_do_not_fit(run: Run, words: list[str], facts: list[str]) -> None:
    said = run("lobes", *words)
    assert (said.code, said.out) == (2, "")
    assert [fact for fact in facts if fact not in said.err] == []
