"""Events, exclusions and new baselines: results they change, and results they do not."""

from __future__ import annotations

import csv
import errno
import io
import json
import os
import re
import shutil
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner, Result

from acquisition import DataError, TapTest
from lobewatch.cli import app
from lobewatch.logbook import Logbook
from lobewatch.machine import MachineFolder
from lobewatch.machine.folder_updates import add_event, exclude_entry, include_entry, withdraw_event
from lobewatch.measurement import Measurement, measure
from lobewatch.show.report.report import render_report

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
SPINDLE = "# The spindle of the example"
SAFE = """
[[program]]
name = "A"
teeth = 4
tool_diameter_mm = 20
radial_depth_mm = 20
direction = "down"
tangential_n_per_mm2 = 1400
radial_n_per_mm2 = 500
speed_rpm = 12900
depth_mm = 0.2

"""


@pytest.fixture
def shop(shop: Shop) -> Shop:
    """Without programs, which take their time."""
    shop.put("")
    return shop


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [*map(str, arguments)], catch_exceptions=False)


def mill(shop: Shop) -> None:
    """Run one program that is safe."""
    shop.edit(SPINDLE, SAFE + SPINDLE)


def day(shop: Shop, days: float) -> datetime:
    found: datetime = shop.start + timedelta(days=days)
    return found


def codes(shop: Shop, days: float) -> list[str]:
    return [remark.code for remark in shop.logbook.status(day(shop, days)).remarks]


def analysed(shop: Shop, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Tap tests that bringing the history up to date analyses."""
    seen: list[str] = []

    def counted(tap: TapTest, *others: Any) -> Measurement:
        seen.append(tap.id)
        return measure(tap, *others)

    with monkeypatch.context() as patch:
        patch.setattr("lobewatch.history.tap_measurements.measure", counted)
        assert shop.logbook.history.rows
    return seen


def newest_id(shop: Shop) -> str:
    found: str = shop.logbook.newest_tap().id
    return found


def test_without_an_excluded_tap_all_is_as_if_it_had_never_been(shop: Shop, tmp_path: Path) -> None:
    mill(shop)
    shop.tap(-30, 1600.0)
    out = newest_id(shop)
    plain = tmp_path / "never" / "m"
    shop.tap_both()
    shop.tap(60, 1705.0)
    shop.tap(60.1, 1680.0, "y")
    shutil.copytree(shop.path, plain, ignore=lambda _, names: [name for name in names if name != "machine.toml"])
    shutil.copy(shop.path / "machine.toml", plain)
    other = MachineFolder(plain)
    for entry in shop.folder.taps():
        if entry.id != out:
            other.commit(shop.folder.read(entry))
    before = shop.logbook.status(day(shop, 61))
    exclude_entry(shop.folder, out, "wrong tool")
    mine, never = shop.logbook, Logbook(other)
    at = day(shop, 61)
    assert mine.status(at) == never.status(at) != before
    columns = ("tap_id", "frequency", "stiffness", "bearing_stiffness", "verdicts", "remarks")
    for row, same in zip(mine.history.rows, never.history.rows, strict=True):
        assert [getattr(row, name) for name in columns] == [getattr(same, name) for name in columns]
    shown = r'<(details|section) id="(events|natural-frequency|bearing-stiffness).*?</(details|section)>'
    pages = [re.sub(shown, "", render_report(one, "reference", "x"), flags=re.DOTALL) for one in (mine, never)]
    assert pages[0].split() == pages[1].split()
    include_entry(shop.folder, out)
    assert shop.logbook.status(at) == before


def test_only_rows_after_an_exclusion_or_a_baseline_are_analysed_again(
    shop: Shop, monkeypatch: pytest.MonkeyPatch
) -> None:
    for month in range(4):
        shop.tap(30 * month, 1713.0 - month)
    ids = [tap.id for tap in shop.logbook.taps]
    assert analysed(shop, monkeypatch) == ids
    exclude_entry(shop.folder, ids[1], "hit the holder")
    assert analysed(shop, monkeypatch) == [ids[2]]  # the mode followed in it is the same, so ids[3] holds
    add_event(shop.folder, "belt changed", day(shop, 80))
    assert analysed(shop, monkeypatch) == []
    add_event(shop.folder, "bearings replaced", day(shop, 80), new_baseline=True)
    assert analysed(shop, monkeypatch) == ids[3:]


def test_a_new_baseline_follows_the_mode_of_a_rebuilt_spindle_and_ends_the_alarm(shop: Shop) -> None:
    shop.tap_both()
    shop.tap(30, 1713.0 * 0.86)
    shop.tap(60, 1713.0 * 1.2)
    assert {"frequency-alarm", "frequency-jump"} <= set(codes(shop, 61))
    event = add_event(shop.folder, "bearings replaced", day(shop, 45), new_baseline=True)
    assert codes(shop, 61) == ["one-direction"]
    logbook = shop.logbook
    series = logbook.status(day(shop, 61)).series_of("reference", "x")
    assert series is not None
    assert series.is_baseline
    assert logbook.assembly().directions == ("x",)
    assert logbook.history.rows[-1].frequency.value == pytest.approx(1713.0 * 1.2, abs=0.5)
    shop.tap(90, 1713.0 * 1.2 * 0.97)
    (found,) = shop.logbook.status(day(shop, 91)).series
    assert found.drop.value == pytest.approx(3.0, abs=0.05)
    withdraw_event(shop.folder, event.id)
    assert "frequency-alarm" in codes(shop, 91)


def test_after_a_new_baseline_nothing_is_known_until_the_next_tap(shop: Shop) -> None:
    mill(shop)
    shop.tap_both()
    add_event(shop.folder, "spindle replaced", day(shop, 10), new_baseline=True)
    standing = shop.logbook.status(day(shop, 11))
    assert (standing.status, [one.code for one in standing.remarks]) == ("unknown", ["never-tapped"])
    assert [one.stability.value for one in shop.logbook.verdicts()] == ["unknown"]
    for command in ("report", "lobes"):
        with pytest.raises(DataError, match="2026-01-25"):
            run(command, shop.path)
    (program,) = json.loads(run("check", shop.path, "--json").stdout)["programs"]
    assert (program["verdict"], program["decided_by"], program["limit_mm"]) == ("doubtful", "no-tap-test", None)


def test_an_old_recording_is_stored_next_to_a_new_baseline(shop: Shop, beam: Path) -> None:
    mill(shop)
    shop.tap_both()
    add_event(shop.folder, "spindle replaced", day(shop, 10), new_baseline=True)
    said = run("replay", shop.path, beam, "--date", "1980-01-01", "--json")
    assert said.exit_code == 0
    assert len(json.loads(said.stdout)["measurements"]) == 1
    assert codes(shop, 11) == ["never-tapped"]


def test_the_report_tells_and_draws_events_and_tests_that_do_not_count(shop: Shop) -> None:
    for month, frequency in enumerate((1713.0, 1650.0, 1300.0, 1712.0)):
        shop.tap(30 * month, frequency)
    for tap in shop.folder.taps()[1:3]:
        exclude_entry(shop.folder, tap.id, "not clamped")
    add_event(shop.folder, "belt changed", day(shop, 40))
    add_event(shop.folder, "door mended", day(shop, -400))
    page = render_report(shop.logbook, "reference", "x")
    told = re.findall(r"<li>(20.*?)</li>", page.replace("\N{NO-BREAK SPACE}", " "))
    assert [line.partition(": ")[2] for line in told] == [
        "door mended",
        "tap test excluded (not clamped), 1650.0 Hz",
        "belt changed",
        "tap test excluded (not clamped), 1300.0 Hz",
    ]
    trend = page[page.index("<h2>Natural frequency") : page.index("<h2>Bearing stiffness")]
    assert trend.count('["excluded",') == 2
    assert trend.count("belt changed") >= 1
    assert "door mended" not in trend


def test_all_taps_excluded(shop: Shop) -> None:
    shop.tap(0, 1713.0)
    exclude_entry(shop.folder, newest_id(shop), "another machine")
    assert codes(shop, 1) == ["never-tapped"]
    with pytest.raises(DataError, match=r"\b1\b.*lobewatch include"):
        run("report", shop.path)
    assert run("history", shop.path).exit_code == 0


def test_an_excluded_recording_is_not_stored_again_but_named(shop: Shop, beam: Path) -> None:
    found = shop.logbook.replay(beam)
    exclude_entry(shop.folder, found.tap_id, "not this machine")
    with pytest.raises(DataError, match=r"'not this machine'.*include"):
        shop.logbook.replay(beam)
    assert len(shop.folder.taps()) == 1


def test_history_lists_taps_exclusions_events_and_verdicts_in_order(shop: Shop) -> None:
    mill(shop)
    shop.tap_both()
    shop.tap(30, 1600.0)
    out = newest_id(shop)
    assert run("exclude", shop.path, out, "--reason", "wrong, tool").exit_code == 0
    assert run("event", shop.path, "bearings replaced", "--date", "2026-02-01", "--new-baseline").exit_code == 0
    assert run("event", shop.path, "before all", "--date", "2025-02-01").exit_code == 0
    shop.tap(60, 1713.0)
    rows = list(csv.DictReader(io.StringIO(run("history", shop.path, "--csv").stdout)))
    assert [row["kind"] for row in rows] == ["event", "tap", "tap", "new baseline", "excluded", "tap"]
    assert float(rows[1]["frequency_hz"]) == pytest.approx(1713.0, abs=0.5)
    assert (rows[4]["id"], rows[4]["reason"], rows[3]["text"]) == (out, "wrong, tool", "bearings replaced")
    assert rows[-1]["verdict: A"] in {"stable", "doubtful"}
    told = json.loads(run("history", shop.path, "--json").stdout)
    assert [len(told[name]) for name in ("taps", "excluded", "events")] == [3, 1, 2]
    assert [tap["baseline"] is None for tap in told["taps"]] == [True, True, False]
    text = run("history", shop.path).stdout
    assert "bearings replaced" in text
    assert "wrong, tool" in text


def test_corrections_are_withdrawn_by_later_lines(shop: Shop) -> None:
    shop.tap(0, 1713.0)
    tap_id = newest_id(shop)
    run("exclude", shop.path, tap_id[:15], "--reason", "doubt")
    run("include", shop.path, shop.path / "taps" / f"{tap_id}.h5")
    run("event", shop.path, "greased", "--date", "2026-02-01")
    run("event", shop.path, "--withdraw", "e1")
    run("event", shop.path, "greased", "--date", "2026-02-01")
    logbook = shop.logbook
    assert [tap.id for tap in logbook.taps] == [tap_id]
    assert [event.id for event in logbook.files.contents.events] == ["e2"]
    kinds = [entry["kind"] for entry in shop.folder.journal.read().entries]
    assert kinds == ["tap", "exclude", "include", "event", "event", "event"]
    assert run("verify", shop.path).exit_code == 0


@pytest.mark.parametrize(
    ("arguments", "facts"),
    [
        (("event", "MACHINE", " "), "event .*text"),
        (("event", "MACHINE", "a\x1bb"), "control character"),
        (("event", "MACHINE", "x", "--date", "2999-01-01"), "MaintenanceEvent.time 2999-01-01.*future"),
        (("event", "MACHINE", "greased", "--date", "2026-01-20"), "'greased' .*2026-01-20.* e1"),
        (
            ("event", "MACHINE", "x", "--date", "2026-01-15", "--new-baseline"),
            "11:24.*MaintenanceEvent.time 2026",
        ),
        (("event", "MACHINE", "--withdraw", "e7"), "e7.* e1"),
        (("event", "MACHINE", "x", "--withdraw", "e1"), "TEXT"),
        (("exclude", "MACHINE", "20990101", "--reason", "x"), "'20990101'.*MachineFolder.contents.* 2"),
        (("exclude", "MACHINE", "2026", "--reason", "x"), "'2026' .*2 tap tests"),
        (("exclude", "MACHINE", "", "--reason", "x"), "''.*MachineFolder.contents"),
        (("exclude", "MACHINE", "TAP", "--reason", " "), "exclude_entry.reason"),
        (("include", "MACHINE", "TAP"), "not excluded"),
        (("history", "MACHINE", "--csv", "--json"), "--csv.*--json"),
    ],
)
def test_wrong_use_is_one_sentence_and_writes_nothing(shop: Shop, arguments: tuple[str, ...], facts: str) -> None:
    shop.tap(0, 1713.0)
    shop.tap(0.1, 1713.0)
    add_event(shop.folder, "greased", datetime(2026, 1, 20).astimezone())
    before = shop.folder.journal.path.read_bytes()
    places = {"MACHINE": str(shop.path), "TAP": shop.folder.taps()[0].id}
    with pytest.raises(ValueError, match=facts):
        run(*(places.get(one, one) for one in arguments))
    assert shop.folder.journal.path.read_bytes() == before


def test_two_events_on_a_day_count_both_and_the_newest_baseline_holds(shop: Shop) -> None:
    shop.tap(0, 1713.0)
    for text in ("front bearings", "rear bearings"):
        add_event(shop.folder, text, day(shop, 10), new_baseline=True)
    add_event(shop.folder, "before the first tap", day(shop, -10), new_baseline=True)
    shop.tap(20, 1713.0)
    first, last = shop.logbook.history.rows
    assert (first.baseline, last.baseline) == (day(shop, -10), day(shop, 10))
    assert len(shop.logbook.files.contents.events) == 3


def test_a_folder_on_a_read_only_disk_is_reported_and_checked(
    shop: Shop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mill(shop)
    shop.tap_both()
    own = os.open

    def read_only(path: Any, flags: int, *others: Any, **more: Any) -> int:
        if str(path).startswith(str(shop.path)) and flags & (os.O_WRONLY | os.O_RDWR):
            raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(path))
        return own(path, flags, *others, **more)

    def refuse(path: Path, _: bytes) -> None:
        os.close(read_only(path, os.O_WRONLY | os.O_CREAT))

    monkeypatch.setattr(os, "open", read_only)
    monkeypatch.setattr("lobewatch.show.report.page.atomic_write", refuse)
    with pytest.raises(DataError, match=r"report\.html.*--out"):
        run("report", shop.path)
    assert run("report", shop.path, "--out", tmp_path / "report.html").exit_code == 0
    assert run("check", shop.path).exit_code in {0, 1}
    assert run("history", shop.path).exit_code == 0
    with pytest.raises(OSError, match=os.strerror(errno.EROFS)) as caught:
        run("event", shop.path, "greased")
    assert caught.value.filename == str(shop.path)
    assert not shop.folder.history_path.exists()
