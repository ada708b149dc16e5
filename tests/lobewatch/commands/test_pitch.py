"""`lobewatch pitch`: proposals checked by time simulation, cases where equal pitch is enough, and mistakes."""

from __future__ import annotations

import json
import math
import re
import sys
from typing import Any

import numpy as np
import pytest
from delayed_milling import DelayedCase, growth_per_turn

from lobewatch.cli import main
from lobewatch.tool.assembly import Assembly

TWO = "teeth = 2\ntool_diameter_mm = 20\nradial_depth_mm = 20"
Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


@pytest.fixture
def ask(shop: Shop, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    """Asks for pitches on the machine of the shop: exit code, stdout, stderr."""

    def call(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["lobewatch", "pitch", str(shop.path), *words])
        capsys.readouterr()
        with pytest.raises(SystemExit) as left:
            main()
        return (int(left.value.code or 0), *capsys.readouterr())

    return call


def simulated(tool: Assembly, pitch: list[float], speed: float, depth: float) -> DelayedCase:
    """Make a slot of the shop (fed along x) with the modes of a tool."""
    sides = ((tool.x or (), 0.0), (tool.y or (), math.pi / 2))
    modes = tuple((m.frequency, m.damping_ratio, m.stiffness, angle) for side, angle in sides for m in side)
    whole = tuple(round(angle) for angle in pitch)
    assert whole == pytest.approx(pitch)
    return DelayedCase(modes, whole, 1.0, "down", 1400e6, 500e6, 0.0, speed, depth)


@pytest.fixture
def tapped(shop: Shop) -> Shop:
    """With a slot of two teeth, fed along x."""
    shop.run(("slot", 13800, 0.8), more='feed = "x"\nfeed_per_tooth_mm = 0.1')
    shop.edit("teeth = 4\ntool_diameter_mm = 20\nradial_depth_mm = 20", TWO)
    shop.tap_both()
    return shop


def test_what_is_proposed_holds_in_a_simulation(tapped: Shop, ask: Any) -> None:
    code, text, _ = ask("--tool", "reference", "--speed", "13800", "--depth", "1.8", "--json")
    answer = json.loads(text)
    assert (code, answer["equal_is_as_good"], answer["remarks"]) == (0, False, [])
    (best,) = answer["unequal"]
    assert answer["proposed_deg"] == best["pitch_deg"]
    assert best["gain"] == pytest.approx(best["limit_mm"] / answer["equal"]["limit_mm"] - 1, rel=1e-6)
    assert best["gain_low"] < best["gain"] < best["gain_high"]
    assert best["limit_low_mm"] >= 1.05 * answer["equal"]["limit_low_mm"]
    assert (answer["equal"]["verdict"], best["verdict"]) == ("not stable", "stable")
    tool = tapped.logbook.assembly()
    growth = growth_per_turn(
        [
            simulated(tool, cutter["pitch_deg"], 13800.0, 1e-3 * cutter["limit_mm"] * share)
            for cutter in (best, answer["equal"])
            for share in (0.99, 1.01)
        ]
    )
    assert np.sign(growth).tolist() == [-1, 1, -1, 1]


def test_a_person_reads_pitches_gain_chips_and_where_they_hold(tapped: Shop, ask: Any) -> None:
    code, text, _ = ask("--speed", "13800")
    assert code == 0
    table = text.splitlines()[:6]
    assert table[2].split()[:3] == ["180", "180", "equal"]
    assert table[4].split()[:3] == ["170", "190", "alternating"]
    assert table[4].split()[-3:] == ["1.06", "8.7", "%"]
    assert max(map(len, table)) <= 80
    assert re.search(r"pitch_deg = \[170, 190\].*13 800 rpm.*58 %", text)
    assert re.search(r"6 %.*0\.106 mm", text)
    assert "at 0.05 mm" not in text


def test_equal_pitch_is_reported_to_be_as_good_where_it_is(tapped: Shop, ask: Any) -> None:
    answer = json.loads(ask("--speed", "24000", "--json")[1])
    assert (answer["equal_is_as_good"], answer["proposed_deg"], answer["depth_mm"]) == (True, None, None)
    assert all(cutter["limit_low_mm"] < 1.05 * answer["equal"]["limit_low_mm"] for cutter in answer["unequal"])
    code, text, _ = ask("--speed", "24000", "--radial", "0.2", "--depth", "0.1")
    assert code == 0
    assert re.search(r"24 000 rpm.* 2 mm", text)


def test_pitches_that_the_cutter_has_are_evaluated_too(tapped: Shop, ask: Any) -> None:
    tapped.edit("teeth = 2", "teeth = 2\npitch_deg = [178, 182]")
    answer = json.loads(ask("--speed", "13800", "--json")[1])
    (present,) = (cutter for cutter in answer["unequal"] if cutter["pattern"] == "as it is")
    assert present["pitch_deg"] == [178, 182]
    assert answer["equal"]["pitch_deg"] == [180, 180]
    assert 0 < present["gain"] < answer["unequal"][0]["gain"]


def test_what_is_no_cutter_or_no_cut_is_rejected(shop: Shop, ask: Any) -> None:
    shop.run(("slot", 6200, 0.8))
    assert ask("--speed", "6200")[0] == 2
    shop.tap_both()
    for words, reason in [
        (("--speed", "6200", "--teeth", "1"), "pitch"),
        (("--speed", "100"), "[speed]"),
        (("--speed", "6200", "--radial", "25"), "tool_diameter_mm"),
        (("--speed", "6200", "--tool", "nobody's"), "nobody's"),
    ]:
        code, out, error = ask(*words)
        assert (code, out) == (2, "")
        assert reason in error
        assert error.count("\n") == 1
