"""`lobewatch recommend`: one speed and depth that `check` calls stable, or none and why; --save; mistakes."""

from __future__ import annotations

import json
import sys
from typing import Any

import pytest

from lobewatch.cli import main
from lobewatch.cuts.learning import production_ladder

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
SAVED = ("--save", "from the answer")


@pytest.fixture
def run(shop: Shop, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    """Run a command on the machine of the shop: exit code, stdout, stderr.

    The ladder has tests of its own, so few samples are enough here.
    """
    monkeypatch.setattr(production_ladder, "N_LADDER_SAMPLES", 50)

    def call(name: str, *words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["lobewatch", name, str(shop.path), *words])
        capsys.readouterr()
        with pytest.raises(SystemExit) as left:
            main()
        return (int(left.value.code or 0), *capsys.readouterr())

    return call


def toml(shop: Shop) -> str:
    return str((shop.path / "machine.toml").read_text("utf-8"))


def test_a_tool_without_a_material_has_that_of_the_reference_cut(shop: Shop, run: Any) -> None:
    shop.tap_both()
    shop.put('[[tool]]\nname = "reference"\nteeth = 4\ndiameter_mm = 20\n')
    code, out, _ = run("recommend", "--radial", "8", "--json")
    given = json.loads(run("recommend", "--radial", "8", "--direction", "up", "--json")[1])
    answer = json.loads(out)
    assert (code, answer["recommended"]["direction"]) == (0, "down")
    assert given["recommended"]["direction"] == "up"
    assert "from-reference-cut" in {remark["code"] for remark in answer["remarks"]}


def test_the_recommended_slot_is_saved_as_a_program_that_check_calls_stable(shop: Shop, run: Any) -> None:
    shop.tap_both()
    before = toml(shop)
    code, out, _ = run("recommend", "--feed-per-tooth", "0.05", *SAVED, "--json")
    answer = json.loads(out)
    best = answer["recommended"]
    assert (code, answer["reason"], answer["saved"]) == (0, None, SAVED[1])
    assert best["chips_cm3_per_min"] == pytest.approx(best["depth_mm"] * 20 * 0.05 * 4 * best["speed_rpm"] / 1000)
    low, high = best["window_rpm"]
    assert low <= 0.99 * best["speed_rpm"] + 10
    assert high >= min(1.01 * best["speed_rpm"] - 10, 24000)
    assert min(best["depth_margin"] - 0.2, best["frequency_left"] - 0.01) >= 0
    assert set(before.splitlines()) <= set(toml(shop).splitlines())
    (checked,) = json.loads(run("check", "--program", SAVED[1], "--json")[1])["programs"]
    assert [checked[key] for key in ("speed_rpm", "depth_mm", "verdict")] == [
        *(best[key] for key in ("speed_rpm", "depth_mm")),
        "stable",
    ]
    limits = [f"limit_{end}mm" for end in ("", "low_", "high_", "at_speed_")]
    assert [best[key] for key in limits] == pytest.approx([checked[key] for key in limits])
    assert best["depth_margin"] == pytest.approx(best["limit_mm"] / best["depth_mm"] - 1)


def test_a_cut_milled_in_either_direction_is_safe_in_both(shop: Shop, run: Any) -> None:
    shop.tap_both()
    of = ("--radial", "12", "--material", "AA 6061")
    best = json.loads(run("recommend", *of, "--json")[1])["recommended"]
    assert best["direction"] == "either"
    for direction in ("up", "down"):
        place = ("--speed", f"{best['speed_rpm']:g}", "--depth", f"{best['depth_mm']:g}", "--direction", direction)
        assert run("check", *of, *place)[0] == 0


def test_a_depth_that_is_asked_for_has_the_fastest_window_and_others_follow(shop: Shop, run: Any) -> None:
    shop.tap_both()
    shop.edit("drop_percent = [0, 0]", "drop_percent = [1, 2]")
    answer = json.loads(run("recommend", "--depth", "1", "--speed", "6500", "--json")[1])
    assert (answer["recommended"]["depth_mm"], answer["recommended"]["drop_at_speed"]) == (1, [0.01, 0.02])
    most, here = answer["alternatives"]
    assert (most["what"], here["what"], here["speed_rpm"]) == ("most chips", "deepest at the present speed", 6500)
    assert most["speed_rpm"] * most["depth_mm"] > answer["recommended"]["speed_rpm"]
    code, out, _ = run("recommend", "--depth", "19.9", *SAVED)
    assert (code, "19.9 mm" in out, "3000..24000 rpm" in out) == (1, True, True)
    assert "from the answer" not in toml(shop)


def test_a_program_without_speed_or_depth_is_recommended_by_check(shop: Shop, run: Any) -> None:
    shop.tap_both()
    shop.edit("speed_rpm = 12900\n", "")
    shop.edit("depth_mm = 0.4\n", "")
    code, out, _ = run("check", "--json")
    said = json.loads(out)
    assert [program["name"] for program in said["programs"]] == ["C"]
    a, b = (answer["recommended"] for answer in said["recommendations"])
    assert (code, a["depth_mm"], b["speed_rpm"]) == (0, 1.5, 8700)
    assert run("check")[1].splitlines()[-1].startswith("3 programs: 1 stable, 2 ")
    shop.edit('name = "A"\n', f'name = "A"\nspeed_rpm = {a["speed_rpm"]:g}\n')
    shop.edit('name = "B"\n', f'name = "B"\ndepth_mm = {b["depth_mm"]:g}\n')
    assert run("check", "--json")[0] == 0


def test_a_spindle_of_one_speed_is_a_narrow_range_and_a_reversed_one_is_rejected(shop: Shop, run: Any) -> None:
    shop.tap_both()
    shop.run(("A", 6500, 0.5))
    shop.edit("low_rpm = 3000\nhigh_rpm = 24000", "low_rpm = 6500\nhigh_rpm = 6500")
    code, _, error = run("recommend")
    assert (code, "6435" in error and "6565" in error) == (2, True)
    shop.edit("low_rpm = 6500\nhigh_rpm = 6500", "low_rpm = 6565\nhigh_rpm = 6435")
    code, _, error = run("recommend")
    assert (code, "high_rpm=6435" in " ".join(error.split())) == (2, True)
    shop.edit("low_rpm = 6565\nhigh_rpm = 6435", "low_rpm = 6435\nhigh_rpm = 6565")
    best = json.loads(run("recommend", "--json")[1])["recommended"]
    assert 6435 <= best["speed_rpm"] <= 6565


def test_without_y_there_is_none_and_tapping_it_would_change_that(shop: Shop, run: Any) -> None:
    shop.tap(0, 1713.0)
    code, out, _ = run("recommend")
    assert (code, out.lower().count("direction y"), "'reference'" in out) == (1, 2, True)


def test_nothing_is_safe_anywhere(shop: Shop, run: Any) -> None:
    taps = [shop.tap(0.1 * i, 1713.0, direction, stiffness=3e5) for i, direction in enumerate("xy")]
    code, out, _ = run("recommend")
    assert (code, "stiffness-off-model" in out) == (1, True)
    shop.logbook.accept(taps, ["stiffness-off-model"])
    answer = json.loads(run("recommend", "--json")[1])
    assert (answer["recommended"], "3000..24000 rpm" in answer["reason"]) == (None, True)
    assert "stick-out" in answer["what_would_change_it"][0]
    assert json.loads(run("check", "--program", "A", "--json")[1])["programs"][0]["advice"] is None


def test_a_tool_that_allows_no_speed_of_the_spindle_has_none(shop: Shop, run: Any) -> None:
    shop.tap_both()
    code, out, _ = run("recommend", "--material", "42CrMo4")
    reason, cures = out.split("Possible remedies:")
    assert code == 1
    assert all(fact in " ".join(reason.split()) for fact in ("reference", "20 mm", "2860 rpm", "180 m/min", "3000 rpm"))
    assert "diameter" in cures
    shop.edit("# The spindle of", '[[tool]]\nname = "reference"\nmax_speed_rpm = 2500\n\n# The spindle of')
    _, out, _ = run("recommend", "--material", "42CrMo4")
    reason, cures = out.split("Possible remedies:")
    assert "2500 rpm" in reason
    assert "max_speed_rpm" in reason
    assert "max_speed_rpm" in cures


def test_a_program_that_runs_at_a_speed_its_tool_does_not_bear_is_not_sent_to_tap_again(shop: Shop, run: Any) -> None:
    shop.tap_both()
    shop.run(("A", 12000, 0.5))
    shop.edit("depth_mm = 0.5\n", "")
    shop.edit("# The spindle of", '[[tool]]\nname = "reference"\nmax_speed_rpm = 9000\n\n# The spindle of')
    code, out, _ = run("check")
    reason, cures = out.split("Possible remedies:")
    assert " rpm" in cures
    assert "tap" not in cures
    assert (code, "12000 rpm" in reason, "3000..9000 rpm" in reason) == (1, True, True)
    assert "speed" in cures


def test_a_tool_that_was_never_tapped_is_predicted_and_reported_to_be_doubtful(shop: Shop, run: Any) -> None:
    shop.tap_both()
    of = ("--material", "AA 6061", "--teeth", "2", "--diameter", "18")
    assert "predicted" in run("recommend", "--tool", "long end mill", *of)[1]
    code, out, _ = run("recommend", "--tool", "new", *of)
    assert (code, "'new'" in out) == (1, True)
    assert "lobewatch tap MACHINE --tool new" in out


@pytest.mark.parametrize(
    ("words", "facts"),
    [
        (["--material", "42CrMo"], ["'42CrMo'", "'42CrMo4'"]),
        (["--save", "A"], ["'A'", "machine.toml"]),
        (["--depth", "21"], ["--depth 21", "diameter"]),
        (["--radial", "-4"], ["--radial -4", "above 0"]),
        (["--radial", "30"], ["radial_depth_mm=30", "tool_diameter_mm=20"]),
        (["--speed", "50000"], ["--speed 50000", "3000..24000 rpm"]),
        (
            ["--tool", "new"],
            ["--material, --teeth, --diameter", "'new'", "machine.toml"],
        ),
        (["--tool", "long end mil"], ["--material, --teeth, --diameter", "machine.toml"]),
    ],
)
def test_one_error_for_what_makes_no_sense(shop: Shop, run: Any, words: list[str], facts: list[str]) -> None:
    shop.tap_both()
    before = toml(shop)
    code, _, error = run("recommend", *words)
    assert (code, [fact for fact in facts if fact not in " ".join(error.split())]) == (2, [])
    assert toml(shop) == before


def test_a_decimal_comma_is_reported_to_be_a_point(run: Any) -> None:
    for command in ("recommend", "check"):
        code, _, error = run(command, "--depth", "1,5")
        assert (code, "'1,5'" in error and "1.5" in error) == (2, True)
