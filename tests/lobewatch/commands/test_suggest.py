"""`lobewatch suggest`: the next test cut, what was learnt, what contradicts, and mistakes."""

from __future__ import annotations

import json
import re
import sys
from typing import Any

import pytest

from lobewatch.cli import main

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


@pytest.fixture
def run(shop: Shop, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    """Run a command on the machine of the shop, whose spindle has few speeds: exit code, stdout, stderr."""
    shop.edit("low_rpm = 3000\nhigh_rpm = 24000", "low_rpm = 6000\nhigh_rpm = 14000")

    def call(name: str, *words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["lobewatch", name, str(shop.path), *words])
        capsys.readouterr()
        with pytest.raises(SystemExit) as left:
            main()
        return (int(left.value.code or 0), *capsys.readouterr())

    return call


def test_cuts_are_suggested_learnt_from_and_come_to_an_end(shop: Shop, run: Any) -> None:
    shop.tap_both()
    cut = json.loads(run("suggest", "--program", "A", "--json")[1])["suggested"]
    assert 0 < cut["chance_of_chatter"] < 0.5
    place = ("--program", "A", "--speed", f"{cut['speed_rpm']:g}", "--depth", f"{cut['depth_mm']:g}")
    assert run("observe", *place, "--stable")[0] == 0
    found = json.loads(run("suggest", "--program", "A", "--json")[1])
    assert (found["cuts_made"], found["cuts_left"]) == (1, 4)
    assert found["best_heard"] == {"speed_rpm": cut["speed_rpm"], "depth_mm": cut["depth_mm"]}
    kt = found["learnt"]["factors"]["tangential"]
    assert kt["mean"] < kt["before"]["mean"]
    assert kt["std"] < kt["before"]["std"]
    assert not found["learnt"]["frequency_learnt"]
    assert [remark["code"] for remark in found["remarks"]] == ["frequency-not-learnt"]
    code, text, _ = run("suggest", "--program", "A", "--cuts", "1")
    assert (code, " 1 test cuts " in text) == (0, True)


def test_power_is_asked_for_where_it_can_say_a_kt(shop: Shop, run: Any) -> None:
    shop.tap_both()
    code, text, _ = run("suggest", "--program", "A")
    assert code == 0
    assert "1 of 5" in text
    assert "--power" not in text
    shop.edit("radial_depth_mm = 20", "radial_depth_mm = 20\nfeed_per_tooth_mm = 0.1")
    text = run("suggest", "--program", "A")[1]
    assert re.search("--stable.*--chatter --frequency HZ.*--power KW", text, re.DOTALL)


def test_a_cut_that_contradicts_is_reported_and_left_out(shop: Shop, run: Any) -> None:
    shop.tap_both()
    for depth_mm, word in ((2.2, "stable"), (2.1, "stable"), (0.2, "chatter")):
        shop.hear(12900, depth_mm, word)
    found = json.loads(run("suggest", "--program", "A", "--json")[1])
    assert found["learnt"]["cuts"] == ["c1", "c2"]
    (odd,) = (remark for remark in found["remarks"] if remark["code"] == "cut-unexplained")
    assert odd["about"] == "c3"


def test_mistakes_are_one_sentence(shop: Shop, run: Any) -> None:
    assert run("suggest", "--program", "A")[0] == 0  # without a tap test, test cuts decide
    shop.tap_both()
    code, _, error = run("suggest", "--program", "Z")
    assert (code, bool(re.search("'Z'.*machine.toml.*'A', 'B', 'C'", error))) == (2, True)
    assert run("suggest", "--program", "A", "--cuts", "0")[0] == 2
