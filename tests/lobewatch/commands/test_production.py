"""Ordinary cuts of `recommend` and the next step after `observe`, and powers without a verdict."""

from __future__ import annotations

import json
import shlex
from typing import Any

import pytest

from lobewatch.machine.folder_updates import make_observed_cut, store_cut
from lobewatch.machine.settings.requested_cut import find_cut_setting
from tests.lobewatch.commands.invoke import invoke

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
MORE = 'feed_per_tooth_mm = 0.1\nfeed = "x"\nprocess_damping_n_per_m = [0, 0]'


@pytest.fixture
def mill(shop: Shop) -> Shop:
    """With both directions tapped and one slot with a feed."""
    shop.tap_both()
    shop.run(("A", 12900, 0.5), more=MORE)
    return shop


def answer(shop: Shop, name: str, *words: str) -> Any:
    return json.loads(invoke([name, str(shop.path), *words, "--json"]).stdout)


def observe(shop: Shop, *words: str) -> Any:
    return answer(shop, "observe", "--program", "A", *words)


def test_a_recommendation_ends_in_ordinary_cuts_and_each_cut_names_the_next(mill: Shop) -> None:
    found = answer(mill, "recommend", "--tool", "reference")
    ladder, recommended = found["ladder"], found["recommended"]
    assert ladder["now"] == {key: recommended[key] for key in ("speed_rpm", "depth_mm")}
    assert 1 <= len(ladder["steps"]) <= 3
    rates = [step["speed_rpm"] * step["depth_mm"] for step in ladder["steps"]]
    assert rates == sorted(rates)
    for step in ladder["steps"]:
        assert 0 <= step["chance_of_chatter"] <= 0.05
        assert step["tells"] == ["power", "verdict", "frequency"]
        assert step["expected_power_kw"] > 0
    first = ladder["steps"][0]
    place = "--speed", f"{first['speed_rpm']:g}", "--depth", f"{first['depth_mm']:g}"
    made = observe(mill, *place, "--stable", "--power", f"{0.8 * first['expected_power_kw']:.3f}")
    rate = made["next_step"]["speed_rpm"] * made["next_step"]["depth_mm"]
    assert rate > rates[0]
    shown, expected = made["next_step"]["expected_power_kw"] / rate, first["expected_power_kw"] / rates[0]
    assert 0.75 * expected < shown < 0.95 * expected
    assert made["asks"] is None


def test_the_help_of_recommend_names_both_policies() -> None:
    text = invoke(["recommend", "--help"]).stdout
    assert all(name in text for name in ("observe", "listen", "suggest"))


def test_a_power_without_a_verdict_is_stored_and_counts_once_a_day(mill: Shop) -> None:
    made = observe(mill, "--power", "1.1")
    assert (made["cut"]["word"], made["cut"]["reason"], made["cut"]["by"]) == (
        "cannot tell",
        "power-reading",
        "display",
    )
    assert made["cut"]["power_kw"] == pytest.approx(1.1)
    assert made["next_step"] is not None
    assert observe(mill, "--power", "1.1")["next_step"] == made["next_step"]
    assert answer(mill, "suggest", "--program", "A")["cuts_made"] == 0
    assert "power reading" in invoke(["history", str(mill.path)]).stdout
    assert "cuts-without-verdict" not in invoke(["check", str(mill.path), "--json"]).stdout


def test_neither_and_both_verdicts_and_odd_powers_are_rejected_and_store_nothing(mill: Shop) -> None:
    for words in ((), ("--stable", "--chatter", "--power", "1.1"), ("--power", "1100"), ("--power", "0.01")):
        with pytest.raises(ValueError, match=r"--(stable|power)"):
            observe(mill, *words)
    assert answer(mill, "history")["cuts"] == []


def test_a_stable_word_against_three_deeper_ones_is_asked_by_its_name_and_corrected_without_a_cut(mill: Shop) -> None:
    for depth in (2.0, 3.0, 2.6):
        setting = find_cut_setting(mill.folder.machine, "A", None, depth)
        store_cut(mill.folder, make_observed_cut(setting, "stable" if depth == 2.0 else "chatter"))
    made = observe(mill, "--depth", "2.3", "--chatter")
    assert (made["asks"], made["next_step"]) == ("c1", None)
    last, later = (answer(mill, "suggest", "--program", "A", "--cuts", cuts) for cuts in ("5", "6"))
    assert (last["asks"], last["suggested"]["repeats"]) == ("c1", None)
    assert (later["asks"], later["suggested"]["repeats"]) == ("c1", "c1")
    lines = invoke(["suggest", str(mill.path), "--program", "A"]).stdout.splitlines()
    assert lines[0] == "Was c1 stable at 12 900 rpm, 2 mm? Other cuts put it in doubt."
    for line in lines[1:3]:
        invoke(shlex.split(line[line.index("lobewatch") : line.index(" (") if " (" in line else None])[1:])
    corrected = answer(mill, "suggest", "--program", "A")
    assert (corrected["asks"], corrected["cuts_made"], corrected["best_heard"]) == (None, 4, None)
