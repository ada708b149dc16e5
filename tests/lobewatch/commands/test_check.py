"""`lobewatch check`: verdicts, uncertainty, safe settings, exit codes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lobes import Program, program_limit
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.show.programs.verdicts import NOT_ROTATING_TEXTS
from lobewatch.verdicts import Advice, Setting
from lobewatch.verdicts.program_case import ProgramCase
from tests.lobewatch.commands.conftest import Check

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


def advised_to(monkeypatch: pytest.MonkeyPatch, best: Setting | None, here: Setting | None) -> None:
    monkeypatch.setattr("lobewatch.logbook.analysis.advise", lambda *_: Advice(best, here))


def test_a_new_spindle_passes_and_an_aged_one_does_not(shop: Shop, check: Check) -> None:
    shop.tap_both()
    good = check()
    assert (good.code, good.last) == (0, "3 programs: 3 stable")
    assert "lobewatch" not in good.out
    shop.tap_both(700, 0.9)
    said = check()
    assert (said.code, said.last) == (1, "3 programs: 1 stable, 2 not stable")
    assert re.search(r" 15\d\d Hz", said.line("A"))
    assert said.code == 1
    assert not re.search(r"^B: ", said.out, re.MULTILINE)


def test_one_direction_is_never_enough_to_be_called_stable(shop: Shop, check: Check, no_search: None) -> None:
    shop.run(("A", 12900, 0.05), ("B", 8700, 0.4))
    shop.tap(0, 1713.0)
    said = check("--json")
    assert said.code == 1
    assert {one["verdict"] for one in said.json["programs"]} == {"doubtful"}
    assert {one["decided_by"] for one in said.json["programs"]} == {"untapped"}
    assert {one["stable"] for one in said.json["programs"]} == {True}
    assert "direction y" in check().line("A")
    assert "'reference'" in check().line("A")
    shop.tap(0.1, 1690.0, "y", tool="another")
    assert (
        check("--json").programs["A"]["verdict"],
        "direction y" in check().line("A"),
    ) == ("doubtful", True)
    shop.tap(0.2, 1690.0, "y")
    both = check("--json")
    assert (both.code, {one["verdict"] for one in both.json["programs"]}) == (0, {"stable"})


def test_without_the_other_direction_nothing_is_recommended(shop: Shop, check: Check) -> None:
    shop.run(("A", 12900, 6))
    shop.tap(0, 1713.0, "y")
    said = check("--json")
    assert (said.programs["A"]["verdict"], said.programs["A"]["advice"]) == ("not stable", None)
    assert "direction x" in check().line("A")
    assert "'reference'" in check().line("A")


def test_the_object_of_a_program(shop: Shop, check: Check) -> None:
    shop.run(("A", 12900, 6))
    shop.tap_both()
    said = check("--json")
    counts = {key: value for key, value in said.json.items() if key not in ("programs", "remarks")}
    assert counts == {"unstable": 1, "doubtful": 0, "not_checked": 0, "beyond_drive": 0, "recommendations": []}
    found = said.programs["A"]
    assert found.keys() >= {
        *("name", "speed_rpm", "depth_mm", "feed", "tap_id", "stable", "verdict", "verdict_at_first"),
        *("limit_mm", "limit_low_mm", "limit_high_mm", "depth_margin", "chance_turning", "decided_by", "cuts"),
        *(
            "advice",
            "advice_here",
            "tolerable_decay",
            "was_stable_at_first",
            "chatter_frequency_hz",
            "kind",
            "measured",
        ),
        *("worst_feed_deg", "drive_limit_mm", "doubt", "method", "method_detail", "remarks"),
    }
    assert not found.keys() & {"nearest_speed_rpm", "speed_margin", "limit_band"}
    assert (found["stable"], found["verdict"], found["cuts"], found["decided_by"]) == (False, "not stable", 0, None)
    for advice in (found["advice"], found["advice_here"]):
        assert advice.keys() == {
            "speed_rpm",
            "depth_mm",
            "window_rpm",
            "depth_margin",
            "frequency_left",
            "chance_turning",
        }
        low, high = advice["window_rpm"]
        assert low <= advice["speed_rpm"] <= high
        assert advice["depth_margin"] >= 0.2
    assert found["advice_here"]["speed_rpm"] == 12900
    assert found["drive_limit_mm"] is None
    assert found["doubt"]["clamping"] == {
        "frequency": [0.003] * 2,
        "damping_ratio": [0.1] * 2,
        "stiffness": [0.03] * 2,
        "phase_deg": [0.0] * 2,
    }
    assert (found["doubt"]["speed"], found["doubt"]["coefficients"]["tangential"]) == (0.01, pytest.approx([-0.2, 0.2]))


def test_the_numbers_are_those_of_the_limit_in_the_worst_feed(shop: Shop, check: Check, no_search: None) -> None:
    shop.tap_both()
    machine, newest = shop.folder.machine, shop.logbook.assembly()
    for entry, table in zip(check("--json").json["programs"], machine.program, strict=True):
        program = Program(machine.build_cut(table), table.speed_rpm, table.depth_mm / 1e3)
        found = program_limit(program, newest.x, newest.y, ProgramCase(table, newest, machine).cuts)
        assert entry["limit_mm"] == pytest.approx(found.limit * 1e3, rel=1e-6)
        assert entry["stable"] == found.stable
        assert entry["worst_feed_deg"] == pytest.approx(np.degrees(found.cut.feed_angle))
        assert entry["depth_margin"] == pytest.approx(entry["limit_mm"] / entry["depth_mm"] - 1)
        assert 0.6 * entry["limit_mm"] < entry["limit_low_mm"] < entry["limit_mm"] < entry["limit_high_mm"]
        assert 0 <= entry["chance_turning"] <= 1


def test_every_recommended_setting_is_stable_when_it_is_entered(shop: Shop, check: Check) -> None:
    shop.run(("A", 12900, 6), ("B", 8700, 3))
    shop.tap_both()
    said = check("--json").json["programs"]
    settings = [one[key] for one in said for key in ("advice", "advice_here") if one[key] is not None]
    assert len(settings) >= 2
    places = [(speed, one["depth_mm"]) for one in settings for speed in (one["speed_rpm"], *one["window_rpm"])]
    shop.run(*((f"P{i}", speed, depth) for i, (speed, depth) in enumerate(places)))
    entered = check("--json")
    assert entered.code == 0
    assert {one["verdict"] for one in entered.json["programs"]} == {"stable"}
    for one, setting in zip(entered.json["programs"][::3], settings, strict=True):
        assert one["depth_margin"] == pytest.approx(setting["depth_margin"], rel=1e-6)
        assert one["depth_margin"] >= 0.2
        assert one["speed_rpm"] % 10 == 0
        assert round(one["depth_mm"] / 0.05, 6).is_integer()


BEST = Setting(23670.0, 6.0, (23320.0, 24000.0), 0.559, 0.1)
FEWER = Setting(12640.0, 2.55, (12510.0, 12880.0), 0.508, 0.025)
HERE = Setting(12900.0, 1.95, (12160.0, 13150.0), 1.02, 0.0)


@pytest.mark.parametrize(
    ("best", "here", "words"),
    [
        (
            BEST,
            None,
            ["23 670 rpm", "23 320 to 24 000 rpm", "55 %", "10 %"],
        ),
        (
            FEWER,
            HERE,
            [
                *("2.55 mm", "12 640 rpm", "12 510 to 12 880 rpm", "50 %", "2.5 %"),
                *("1.95 mm", "12 160 to 13 150 rpm", "102 %", "another 1 %", "3 000 to 24 000 rpm"),
            ],
        ),
        (
            HERE,
            HERE,
            ["1.95 mm", "12 160 to 13 150 rpm", "102 %", "another 1 %", "3 000 to 24 000 rpm"],
        ),
        (None, None, ["tool", "3 000 to 24 000 rpm"]),
    ],
)
def test_advice_in_words(
    shop: Shop,
    check: Check,
    monkeypatch: pytest.MonkeyPatch,
    best: Setting | None,
    here: Setting | None,
    words: list[str],
) -> None:
    shop.run(("A", 12900, 6), ("D", 12900, 3))
    shop.tap_both()
    advised_to(monkeypatch, best, here)
    said = check()
    assert re.search(r"\b16\d\d Hz", said.line("A"))
    assert max(map(len, said.out.splitlines())) <= 90
    found = [said.line("A").find(word) for word in words]
    assert -1 not in found
    assert found == sorted(found)
    if best is not BEST:
        assert all(word in said.line("D") for word in words)


def test_a_doubtful_program_says_what_would_settle_it(shop: Shop, check: Check, no_search: None) -> None:
    shop.run(("A", 12900, 3))
    shop.tap_both()
    said = check("--json").programs["A"]
    assert (said["verdict"], said["stable"], said["decided_by"]) == ("doubtful", True, "coefficients")
    assert [one["code"] for one in said["remarks"]] == ["doubt-decides"]
    text = check()
    decided = re.search(r"Kt (\d+) N/mm2", text.line("A"))
    assert decided is not None
    assert float(decided[1]) == pytest.approx(1400 * said["limit_mm"] / 3, abs=1)
    assert text.out.count(decided[0]) == 1
    assert text.last == "1 program: 1 doubtful"
    assert "material" in text.line("A")
    shop.edit("[speed]", "[doubt]\ncoefficients_percent = 1\nspeed_percent = 0.1\ndamping_percent = 1\n\n[speed]")
    settled = check("--json")
    assert (settled.code, settled.programs["A"]["verdict"]) == (0, "stable")


def test_the_uncertainty_is_reported_with_its_sources_and_once(shop: Shop, check: Check, no_search: None) -> None:
    shop.tap_both()
    default = ("±0.3 %", "±10 %", "±3 %", "8 tests", "±1 %", "±20 %")
    said = check().out
    assert [said.count(fact) for fact in default] == [1] * len(default)
    assert [said.count(text) for text in NOT_ROTATING_TEXTS] == [1, 1]
    shop.edit("[speed]", "[doubt]\nfrequency_percent = 0.5\nspeed_percent = 2\ncoefficients_percent = 7\n\n[speed]")
    said = check().out
    assert all(fact in said for fact in ("±0.5 %", "±10 %", "±3 %", "±2 % (machine.toml)", "±7 % (machine.toml)"))


def test_other_uncertainties_are_reported_by_program(shop: Shop, check: Check, no_search: None) -> None:
    slot = (
        "teeth = 4\ntool_diameter_mm = 20\nradial_depth_mm = 20\ndirection = 'down'\nspeed_rpm = 9000\ndepth_mm = 0.2\n"
    )
    own = "tangential_n_per_mm2 = 1400\nradial_n_per_mm2 = 500\n"
    shop.put(
        f"[[program]]\nname = 'Al'\nmaterial = 'Al 7075 (HSS; dry)'\n{slot}"
        f"[[program]]\nname = 'long'\ntool = 'long end mill'\n{own}{slot}"
    )
    shop.tap(0, 1713.0)
    said = check().out
    of_al, of_long = re.split(r"^Uncertainty of (?:Al|long) .*:$", said, flags=re.MULTILINE)[1:]
    assert re.search(r"±5 %.*±30 %.*Kt .*Al 7075", of_al, re.DOTALL)
    assert re.search(r"±3 %.*±30 %.*±15 %.*±5 %.*±30 %.*±1 %", of_long, re.DOTALL)
    assert check("--json").programs["long"]["doubt"]["prediction"]["damping_ratio"] == [0.3] * 2
    assert "'long end mill'" in said


def test_a_material_that_is_named_is_not_asked_for(shop: Shop, check: Check, no_search: None) -> None:
    shop.tap_both()
    said = check("--speed", "8700", "--depth", "1", "--material", "42CrMo4")
    assert (said.code, said.last) == (1, "1 program: 1 doubtful")
    assert re.search(r"Kt \d+ N/mm2", said.out)
    assert "material" not in said.line("8700 rpm, 1 mm")


def test_the_uncertainty_of_a_listed_material_is_its_published_range(shop: Shop, check: Check, no_search: None) -> None:
    shop.run(("A", 12900, 0.2))
    shop.edit("tangential_n_per_mm2 = 1400\nradial_n_per_mm2 = 500\nspeed", 'material = "AISI 4140"\nspeed')
    shop.edit("[speed]", "[doubt]\ncoefficients_percent = 7\n\n[speed]")
    shop.tap_both()
    known = check("--json").programs["A"]["doubt"]["coefficients"]
    assert known["tangential"] == pytest.approx([1929 / 2726 - 1, 4031 / 2726 - 1], abs=1e-3)
    assert known["radial_over_tangential"] == pytest.approx([0.13 / 0.27 - 1, 1.0])
    assert re.search(r"Kt -29..\+48 %, Kr/Kt -52..\+100 %.*42CrMo4", check().out)


def test_a_series_of_eight_tells_its_own_scatter(shop: Shop, check: Check, no_search: None) -> None:
    shop.run(("A", 12900, 1))
    for day in range(8):
        wobble = 1 + 3e-4 * (-1) ** day
        shop.tap(day, 1713.0 * wobble)
        shop.tap(day + 0.1, 1690.0 / wobble, "y")
        if day == 6:
            before = check("--json").programs["A"]
    now = check("--json").programs["A"]
    assert (before["doubt"]["clamping"]["frequency"], before["doubt"]["clamping"]["damping_ratio"][0]) == (
        [0.003] * 2,
        0.1,
    )
    steps = np.diff(np.log(1 + 3e-4 * (-1.0) ** np.arange(8)))
    expected = np.std(steps, ddof=1) / np.sqrt(2) * 2.4469
    assert now["doubt"]["clamping"]["frequency"] == pytest.approx([expected] * 2, rel=0.01)
    assert now["doubt"]["clamping"]["damping_ratio"][0] < 0.01
    assert now["limit_high_mm"] - now["limit_low_mm"] < before["limit_high_mm"] - before["limit_low_mm"]
    assert "8 tests" in check().out


def test_the_drive_and_missing_taps_are_reported(shop: Shop, check: Check, no_search: None) -> None:
    shop.run(("A", 12900, 1.5), ("B", 8700, 0.4), ("C", 6500, 1.0))
    shop.edit("speed_rpm = 12900", "feed_per_tooth_mm = 0.1\nspeed_rpm = 12900")
    shop.edit("[speed]", "[drive]\npower_kw = 0.5\n\n[speed]")
    shop.edit('name = "B"\ntool = "reference"', 'name = "B"\ntool = "T7"')
    shop.tap_both()
    said = check()
    assert (said.code, said.last) == (1, "3 programs: 2 stable, 1 unknown, 1 beyond the drive")
    power = 4 * 0.02 / (4 * np.pi) * 2 * 1400e6 * 1e-4 * 2 * np.pi * 12900 / 60
    assert "[drive]" in said.line("A")
    assert f" {np.floor(500 / power * 1e5) / 100:.2f} mm" in said.line("A")
    assert re.search(r"^A .* stable, ", said.out, re.MULTILINE)
    assert "'T7'" in said.line("B")
    assert re.search(r"\bC: .*\[drive\].*feed_per_tooth_mm", said.out)
    found = check("--json")
    assert (found.json["not_checked"], found.json["beyond_drive"], found.programs["A"]["stable"]) == (1, 1, True)
    unknown = found.programs["B"]
    assert {key for key, value in unknown.items() if value is None} >= {
        *(
            "stable",
            "limit_mm",
            "limit_low_mm",
            "limit_high_mm",
            "chance_turning",
            "decided_by",
            "advice",
            "advice_here",
        ),
        *("doubt", "chatter_frequency_hz", "worst_feed_deg", "tolerable_decay", "depth_margin"),
    }


def test_stable_beyond_the_drive_is_no_success(shop: Shop, check: Check) -> None:
    shop.run(("A", 12900, 1.5), more="feed_per_tooth_mm = 0.1")
    shop.edit("[speed]", "[drive]\npower_kw = 0.5\n\n[speed]")
    shop.tap_both()
    said = check("--json")
    assert (said.code, said.programs["A"]["verdict"]) == (1, "stable")


def test_a_band_without_modes_leaves_programs_unknown(shop: Shop, check: Check) -> None:
    shop.tap_both()
    shop.edit("band_hz = [1200, 2200]", "band_hz = [2000, 2200]")
    said = check()
    assert (said.code, said.last) == (1, "3 programs: 3 unknown")
    assert "[mode] band_hz 2000..2200 Hz" in said.line("A")
    assert "1690 Hz" in said.line("A")
    assert "±" not in said.out
    assert {one["verdict"] for one in check("--json").json["programs"]} == {"unknown"}


def test_the_feed_of_a_program_counts(shop: Shop, check: Check, no_search: None) -> None:
    limits, worst = {}, {}
    shop.tap(0, 1713.0, stiffness=3e7)
    shop.tap(0.1, 1400.0, "y", stiffness=9e7)
    for feed in ("x", "y", "both"):
        half = f'feed = "{feed}"'
        shop.run(("A", 12900, 1), more=half)
        shop.edit(
            'radial_depth_mm = 20\ndirection = "down"\ntangential_n_per_mm2 = 1400\nradial_n_per_mm2 = 500\nspeed',
            ('radial_depth_mm = 12\ndirection = "down"\ntangential_n_per_mm2 = 1400\nradial_n_per_mm2 = 500\nspeed'),
        )
        found = check("--json").programs["A"]
        limits[feed], worst[feed] = found["limit_mm"], found["worst_feed_deg"]
        assert found["feed"] == feed
    assert 0.9 * min(limits["x"], limits["y"]) < limits["both"] < 0.95 * min(limits["x"], limits["y"])
    assert (worst["x"], worst["y"]) == (0, pytest.approx(90))
    assert worst["both"] % 90 != 0
    assert abs(limits["x"] / limits["y"] - 1) > 0.05


SPEEDS = "high_rpm = 24000\nsteps = 200\n"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (SPEEDS, "[doubt]\nspeed_percent = -3\n", ("doubt", "speed_percent", ">= 0.0", "-3")),
        (SPEEDS, "[doubt]\nspeed_percent = 120\n", ("doubt", "speed_percent", "<= 100.0", "120")),
        (SPEEDS, "[doubt]\ndamping_percent = nan\n", ("doubt", "damping_percent", ">= 0.0", "nan")),
        (SPEEDS, "[doubt]\nspeed_percnt = 1\n", ("doubt", "'speed_percnt'", "'speed_percent'")),
        ("depth_mm = 0.4", 'feed = "z"\ndepth_mm = 0.4', ("program 2", "'z'", '"x", "y"')),
        (
            "depth_mm = 0.4",
            "flute_length_mm = 0\ndepth_mm = 1",
            ("program 2", "flute_length_mm", "> 0.0"),
        ),
        (
            "depth_mm = 0.4",
            "flute_length_mm = 1\ndepth_mm = 2",
            ("program 2", "depth_mm=2", "flute_length_mm"),
        ),
        ("speed_rpm = 12900", "speed_rpm = 25000", ("program 1", "25000", "3000..24000 rpm")),
    ],
)
def test_bad_input_is_one_sentence_with_place_and_value(
    shop: Shop, check: Check, old: str, new: str, message: tuple[str, ...]
) -> None:
    shop.edit(old, new)
    said = check()
    assert said.code == 2
    assert said.err.startswith("error: ")
    assert all(fact in said.err for fact in message)
    assert "Traceback" not in said.err


def test_no_longer_is_reported_of_the_same_directions_only(shop: Shop, check: Check, no_search: None) -> None:
    shop.tap_both()
    shop.tap(700, 1713.0 * 0.9)
    shop.tap(700.1, 1690.0 * 0.9, "y")
    assert (
        sum(one["was_stable_at_first"] is True and not one["stable"] for one in check("--json").json["programs"]) == 2
    )
    shop.run(("A", 12900, 1.5), tool="another")
    shop.tap(0, 1713.0, tool="another")
    shop.tap(700, 1713.0 * 0.9, tool="another")
    shop.tap(700.1, 1690.0 * 0.9, "y", tool="another")
    (found,) = check("--json").json["programs"]
    assert (found["verdict"], found["was_stable_at_first"]) == ("not stable", None)


def test_check_without_anything_to_check_is_rejected(shop: Shop, check: Check, tmp_path: Path) -> None:
    assert check().code == 1  # without a tap test, programs are at best doubtful
    make_machine_folder(tmp_path / "plain", "new_machine.toml")
    said = check(folder=tmp_path / "plain")
    assert (said.code, "[[program]]" in said.err) == (2, True)


def test_only_the_programs_that_are_named_are_checked(shop: Shop, check: Check, no_search: None) -> None:
    shop.tap_both(700, 0.9)
    every = check("--json").programs
    said = check("--program", "B", "--json")
    assert (said.code, said.programs) == (0, {"B": every["B"]})
    said = check("--program", "C", "--program", "A", "--json")
    assert (said.code, said.programs) == (1, {"A": every["A"], "C": every["C"]})
    assert check("--program", "B").last == "1 program: 1 stable"


def test_a_program_that_is_not_there_is_rejected_with_those_that_are(shop: Shop, check: Check) -> None:
    shop.tap_both()
    said = check("--program", "B", "--program", "D")
    assert (said.code, said.out) == (2, "")
    assert all(fact in said.err for fact in ("'D'", "machine.toml", "'A', 'B', 'C'"))
    said = check("--program", "B", "--depth", "1")
    assert (said.code, "--program" in said.err) == (2, True)
