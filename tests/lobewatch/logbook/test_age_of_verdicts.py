"""Verdicts on old tap tests: at most doubtful beyond two agreed intervals, the same everywhere, and never stored."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from acquisition import TapDirection
from lobewatch.fleet.fleet import Fleet
from lobewatch.logbook import LobeComparison, Logbook, compare_lobes
from lobewatch.logbook.requested_cuts import recommend_requested
from lobewatch.notify.prometheus import format_prometheus
from lobewatch.notify.publish_status import make_message_content
from lobewatch.show.fleet.fleet_status import fleet_row
from lobewatch.show.programs.verdicts import verdict_json
from lobewatch.show.report.report_data import collect_report_data
from lobewatch.tool import DynamicsSource, LobeMethod
from tests.lobewatch.commands.invoke import invoke
from tests.lobewatch.conftest import START, Shop

NEW, OLD = START + timedelta(days=59), START + timedelta(days=61)
"""Below and beyond two intervals of 30 days after the newest tap test."""
CUT = {"tool": "reference", "material": "AA 6061", "depth_mm": 0.5}


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make a machine with a stable program and an agreed interval."""
    shop = Shop(tmp_path_factory.mktemp("mills") / "m")
    shop.run(("B", 8700, 0.4))
    shop.edit("# tap_interval_days = 30", "tap_interval_days = 30")
    shop.tap_both()
    _ = shop.logbook.history
    return shop.path


@pytest.fixture
def without_interval(path: Path) -> Iterator[Path]:
    toml = path / "machine.toml"
    text = toml.read_text("utf-8")
    toml.write_text(text.replace("tap_interval_days = 30", "# tap_interval_days = 30"), "utf-8")
    yield path
    toml.write_text(text, "utf-8")


def chart(logbook: Logbook) -> LobeComparison:
    return compare_lobes(logbook, None, "B", DynamicsSource.MODES, LobeMethod.ZERO_ORDER)


def everywhere(path: Path, now: datetime) -> dict[str, str]:
    """Return the verdict on the same cut in every output."""
    logbook = Logbook.open(path, now)
    (verdict,) = logbook.verdicts()
    (machine,) = Fleet({"m": path}).assess_machines(now)
    (charted,) = chart(logbook).verdicts
    (reported,) = logbook.query(collect_report_data, "reference", "x", None).programs
    (label,) = (line for line in format_prometheus([machine]).splitlines() if 'program="B"' in line)
    return {
        "check": verdict.stability,
        "a cut of its own": logbook.verdict_for(verdict.program).stability,
        "lobes": charted.stability,
        "report": reported.verdict.stability,
        "status": fleet_row(machine)["programs"]["B"],
        "MQTT": make_message_content(machine)["programs"]["B"],
        "Prometheus": label.partition('word="')[2].partition('"')[0],
    }


def test_the_verdict_is_the_same_everywhere(path: Path) -> None:
    assert set(everywhere(path, NEW).values()) == {"stable"}
    assert set(everywhere(path, OLD).values()) == {"doubtful"}


@pytest.fixture
def copied(path: Path, tmp_path: Path) -> Shop:
    """Return a copy of the machine, to be tapped further."""
    shop = Shop(tmp_path / "new")
    shop.path = shutil.copytree(path, tmp_path / "m")
    return shop


def test_one_new_direction_makes_the_other_no_younger(copied: Shop) -> None:
    copied.tap(60.5, 1713.0)
    assert set(everywhere(copied.path, OLD).values()) == {"doubtful"}
    logbook = Logbook.open(copied.path, OLD)
    (verdict,) = logbook.verdicts()
    assert (verdict.decisive_cause, verdict_json(verdict)["tap_age_days"]) == ("unchecked", 60)
    assert "tap-too-old" in {remark.code for remark in logbook.status().remarks}
    copied.tap(60.6, 1690.0, "y")
    (verdict,) = Logbook.open(copied.path, OLD).verdicts()
    assert (verdict.stability, verdict_json(verdict)["tap_age_days"]) == ("stable", 0)


@pytest.mark.parametrize(("direction", "frequency", "days"), [("x", 1713.0, 0.1), ("y", 1690.0, 0.0)])
def test_a_prediction_is_as_old_as_the_tests_behind_it(
    copied: Shop, direction: TapDirection, frequency: float, days: float
) -> None:
    copied.tap(60.5, frequency, direction)
    logbook = copied.logbook
    times = [logbook.history.tapped_since(tool) for tool in ("reference", "long end mill")]
    assert times == [START + timedelta(days=days)] * 2
    assert logbook.assembly("long end mill").predicted


def test_age_leaves_an_earlier_cause(path: Path, tmp_path: Path) -> None:
    shop = Shop(tmp_path / "m")
    (shop.path / "machine.toml").write_text((path / "machine.toml").read_text("utf-8"), "utf-8")
    shop.tap(0.0, 1713.0)
    for now, codes in ((NEW, set[str]()), (OLD, {"tap-too-old"})):
        (verdict,) = Logbook.open(shop.path, now).verdicts()
        assert (verdict.stability, verdict.decisive_cause) == ("doubtful", "untapped")
        assert codes == {remark.code for remark in verdict.remarks} & {"tap-too-old"}


def test_the_cause_and_the_remedy_are_named(path: Path) -> None:
    logbook = Logbook.open(path, OLD)
    (verdict,) = logbook.verdicts()
    own = logbook.verdict_for(verdict.program)
    for one in (verdict, own):
        assert (one.decisive_cause, verdict_json(one)["tap_age_days"]) == ("unchecked", 61)
        codes = {remark.code: remark.cure for remark in one.remarks}
        assert codes["tap-too-old"] == codes["doubt-decides"] == "Tap again"
    assert verdict_json(verdict) | {"worst_feed_deg": 0} == verdict_json(own) | {"worst_feed_deg": 0}
    assert [remark.code for remark in verdict.remarks] == [remark.code for remark in own.remarks]


def test_no_setting_is_recommended_on_an_old_test(path: Path) -> None:
    answers = [recommend_requested(Logbook.open(path, now), CUT, None) for now in (NEW, OLD)]
    assert [answer.setting is not None for answer in answers] == [True, False]
    assert answers[1].remedies == ("Tap again",)
    assert chart(Logbook.open(path, OLD)).pockets == []


def test_stored_verdicts_do_not_depend_on_the_clock(path: Path) -> None:
    stored = {}
    for now in (NEW, OLD, NEW):
        (path / "history.rows").unlink(missing_ok=True)
        logbook = Logbook.open(path, now)
        _ = logbook.verdicts()
        stored[now] = (path / "history.rows").read_bytes()
        assert (logbook.history.rows[-1].verdicts or {})["B"].stability == "stable"
        (machine,) = Fleet({"m": path}).assess_machines(now)
        assert machine.summary.programs == {"B": "stable"}
    assert stored[NEW] == stored[OLD]


def test_status_names_each_program_on_an_old_test(path: Path) -> None:
    (machine,) = Fleet({"m": path}).assess_machines(OLD)
    direct = Logbook.open(path, OLD).status()
    for found in (machine.current.remarks, direct.remarks):
        assert [remark.about for remark in found if remark.code == "tap-too-old"] == ["B"]
    assert (machine.current.next_step, fleet_row(machine)["tap_age_days"]) == ("Tap again", 60)


def test_without_an_agreed_interval_it_is_a_remark_only(without_interval: Path) -> None:
    assert set(everywhere(without_interval, OLD).values()) == {"stable"}
    (verdict,) = Logbook.open(without_interval, OLD).verdicts()
    assert "tap-old" in {remark.code for remark in verdict.remarks}
    (verdict,) = Logbook.open(without_interval, NEW).verdicts()
    assert "tap-old" not in {remark.code for remark in verdict.remarks}
    assert recommend_requested(Logbook.open(without_interval, OLD), CUT, None).setting is not None


def test_a_clock_before_the_newest_test_keeps_its_own_remark(path: Path) -> None:
    early = START - timedelta(days=100)
    logbook = Logbook.open(path, early)
    (verdict,) = logbook.verdicts()
    assert verdict.stability == "stable"
    assert "tap-in-future" in {remark.code for remark in logbook.status().remarks}


@pytest.mark.parametrize(("now", "code", "word"), [(NEW, 0, "stable"), (OLD, 1, "doubtful")])
def test_check_takes_the_date_as_an_option(path: Path, now: datetime, code: int, word: str) -> None:
    day = now.astimezone().strftime("%Y-%m-%dT%H:%M:%S")
    told: Any = invoke(["check", str(path), "--now", day, "--json"])
    (program,) = json.loads(told.stdout)["programs"]
    assert (told.exit_code, program["verdict"]) == (code, word)
    (machine,) = json.loads(invoke(["status", str(path), "--now", day, "--json"]).stdout)["machines"]
    assert machine["programs"] == {"B": word}
