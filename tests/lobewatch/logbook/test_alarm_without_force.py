"""A fall that is tapped without force: the alarm and the forecast are those of the same fall tapped with it."""

from __future__ import annotations

import json
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from acquisition import Circumstances, Hit, HitFlags, Structure, TapTest, new_tap_id
from lobewatch.cli import app
from lobewatch.logbook.machine_forecast import forecast_machine
from tests.lobewatch.conftest import Shop
from tests.lobewatch.logbook.test_alarm_life import LONG_AGO, MONTH, WIGGLE, alarms, at, codes, falling, tap_months

RATE, SIZE, BEFORE = 12_800.0, 2560, 128
WITHOUT = '[tap]\nhammer = "none"\n'


def decays(frequency: float, seed: int) -> list[Hit]:
    """Three hits on a mode of 3 % damping, without a measured force; noise of 1 m/s^2."""
    random, structure = np.random.default_rng(seed), Structure(np.array([frequency]), np.array([0.03]), np.array([3e7]))
    time = np.arange(SIZE - BEFORE) / RATE
    hits = []
    for _ in range(3):
        acceleration = random.normal(scale=1.0, size=SIZE)
        acceleration[BEFORE:] += random.uniform(150, 350) * structure.response(time, random.uniform(0.5e-3, 0.8e-3))
        hits.append(Hit(np.empty(0), acceleration, RATE, BEFORE))
    return hits


@pytest.fixture
def shops(shop: Shop, new_shop: type[Shop], tmp_path: Path) -> tuple[Shop, Shop]:
    """Make the same drop over 18 months with force and without force."""
    bare, falls = new_shop(tmp_path / "without-force"), falling(18)
    for either in (shop, bare):
        either.put("")
    tap_months(shop, falls)
    bare.edit("[tap]\n", WITHOUT)
    toml = bare.path / "machine.toml"
    toml.write_text(
        "\n".join(line for line in toml.read_text("utf-8").splitlines() if "trigger_n" not in line), "utf-8"
    )
    for month, fall in enumerate(falls):
        about = Circumstances("m", bare.start + timedelta(days=LONG_AGO + MONTH * month), "reference", "x")
        hits = decays(1713.0 * (1 - (fall + WIGGLE[month % 5]) / 100), month)
        bare.folder.commit(TapTest(new_tap_id(about), about, None, tuple(hits), (HitFlags.OK,) * 3))
    return shop, bare


def run(shop: Shop, *words: str) -> Any:
    return json.loads(CliRunner().invoke(app, [words[0], str(shop.path), *words[1:], "--json"]).stdout)


def test_alarm_trend_and_forecast_are_those_with_a_hammer(shops: tuple[Shop, Shop]) -> None:
    with_force, without = shops
    assert "decay" in codes(with_force, 18)
    assert codes(without, 18) == codes(with_force, 18)
    raised = [[(alarm.code, alarm.about, alarm.triggered_at) for alarm in alarms(shop, 18)] for shop in shops]
    assert raised[1] == raised[0] != []
    known, bare = (forecast_machine(shop.logbook, at(shop, 18)) for shop in shops)
    falls = [found.status.series[0].drop for found in (known, bare)]
    assert falls[1].value == pytest.approx(falls[0].value, abs=0.01)  # %
    for percent, reach in known.limits:
        days = [dict(found.limits)[percent].probable for found in (known, bare)]
        assert reach.earliest is not None
        assert reach.latest is not None
        assert days[1] == pytest.approx(days[0], abs=0.05 * (reach.latest - reach.earliest) + 1)
    assert {tap["stiffness_n_per_m"] for tap in run(without, "history")["taps"]} == {None}
    bearings = [shop.logbook.history.rows[-1].bearing_stiffness.value for shop in shops]
    assert bearings[1] == pytest.approx(bearings[0], rel=5e-3)
