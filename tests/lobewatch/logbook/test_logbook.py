"""Logbook: every tap test analyzed once, independent readers, one verdict everywhere."""

from __future__ import annotations

import ctypes
import json
import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from numpy.typing import ArrayLike
from typer.testing import CliRunner, Result

import lobes
from acquisition import Circumstances, TapDirection, TapTest, from_accelerance, new_tap_id
from lobes import Cut, Program, ProgramLimit, program_limit, zero_order_lobes
from lobes.tip_response import TipModes
from lobewatch import Logbook
from lobewatch.cli import app
from lobewatch.fleet.fleet import Fleet
from lobewatch.history.history_cache import HistoryCache
from lobewatch.logbook import compare_lobes
from lobewatch.machine import MachineFolder, ProgramTable
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.machine.row_file import read_rows, write_rows
from lobewatch.measurement import Measurement, measure
from lobewatch.show.fleet.fleet_status import fleet_rows
from lobewatch.show.programs.verdicts import VERDICT_STYLES
from lobewatch.show.report.report import render_report
from lobewatch.show.trend import change_text
from lobewatch.tap.session import build_outcome
from lobewatch.tool.lobe_chart import DynamicsSource, LobeMethod
from lobewatch.verdicts import Advice, Stability, Verdict
from lobewatch.verdicts.program_case import build_program
from lobewatch.verdicts.verdict import evaluate_program
from modal import Mode, synthesize_frf

START = datetime(2026, 1, 15, 9, tzinfo=UTC)
LINES = np.arange(4.0, 4000.0, 4.0)
DISPUTED = """
[[program]]
name = "disputed"
teeth = 2
tool_diameter_mm = 20
radial_depth_mm = 10
direction = "down"
tangential_n_per_mm2 = 2500
radial_n_per_mm2 = 900
speed_rpm = 16000
depth_mm = 4.55
"""
"""With x and y at 1541.74 Hz: 4.74 mm and stable by zero order, 4.40 mm and not stable by semi-discretisation."""


Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


@pytest.fixture
def path(shop: Shop) -> Path:
    """Make the example machine with few speeds and programs that are stable when it is new."""
    folder: Path = shop.path
    return folder


def add_programs(path: Path, text: str) -> None:
    toml = path / "machine.toml"
    head, mark, tail = toml.read_text("utf-8").partition("# The spindle of the example")
    toml.write_text(f"{head}{text}\n{mark}{tail}", "utf-8")


def tap(path: Path, days: float, frequency: float, direction: TapDirection = "x", tool: str = "reference") -> None:
    folder = MachineFolder(path)
    about = Circumstances("m", START + timedelta(days=days), tool, direction, "", folder.toml.read_text("utf-8"))
    frf = synthesize_frf([Mode(frequency, 0.029136, 3.48e7)], LINES)
    folder.commit(TapTest(new_tap_id(about), about, from_accelerance(LINES, frf.accelerance)))


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [*map(str, arguments)], catch_exceptions=False)


@pytest.fixture
def analysed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Identities of the tap tests analysed from now on."""
    found: list[str] = []

    def counting(tap: TapTest, *known: Any) -> Measurement:
        found.append(tap.id)
        return measure(tap, *known)

    monkeypatch.setattr("lobewatch.history.tap_measurements.measure", counting)
    return found


@pytest.mark.parametrize(
    ("command", "most"), [("check", 4), ("lobes", 4), ("report", 4), ("model", 1)], ids=lambda value: str(value)
)
def test_no_command_analyses_a_tap_twice(
    path: Path, analysed: list[str], monkeypatch: pytest.MonkeyPatch, command: str, most: int
) -> None:
    monkeypatch.setattr("lobewatch.logbook.analysis.advise", lambda *_: Advice())
    table = DISPUTED.partition('name = "disputed"')[2]
    add_programs(path, "".join(f'[[program]]\nname = "P{i}"{table}' for i in range(3)))
    for month in range(3):
        tap(path, 30 * month, 1713.0 - 10 * month)
        tap(path, 30 * month + 0.1, 1690.0 - 10 * month, "y")
    assert len(Logbook.open(path).history.rows) == 6
    assert Counter(analysed).most_common(1)[0][1] == 1
    analysed.clear()
    run(command, path)
    assert len(analysed) == len(set(analysed)) <= most


def test_a_reader_next_to_a_writer_reads_on_and_writes_nothing(path: Path) -> None:
    tap(path, 0, 1713.0)
    Logbook.open(path).status()
    before = (path / "history.rows").read_bytes()
    with MachineFolder(path).locked():
        tap(path, 30, 1690.0)
        said = run("check", path, "--json")
        shown = run("lobes", path)
    assert json.loads(said.stdout)["programs"][0]["tap_id"].startswith("20260214")
    assert "history.rows" in shown.stdout
    assert (path / "history.rows").read_bytes() == before
    assert "history.rows" not in run("lobes", path).stdout
    assert (path / "history.rows").read_bytes() != before


def without_override() -> None:
    """Make file permissions count for root too (PR_CAPBSET_DROP, CAP_DAC_OVERRIDE)."""
    if os.geteuid() == 0:
        ctypes.CDLL(None).prctl(24, 1)


@pytest.mark.skipif(sys.platform != "linux", reason="drops a capability of Linux")
def test_a_folder_that_cannot_be_written_is_read(shop: Shop, path: Path) -> None:
    shop.run(("A", 12900, 1.5))
    tap(path, 0, 1713.0)
    tap(path, 0.1, 1690.0, "y")
    path.chmod(0o555)
    try:
        for name, *options in (["check"], ["lobes"], ["report", "--out", str(path.parent / "r.html")], ["report"]):
            command = [sys.executable, "-m", "lobewatch.cli", name, str(path), *options]
            said = subprocess.run(command, capture_output=True, text=True, preexec_fn=without_override, check=False)
            if (name, options) == ("report", []):
                assert said.returncode == 2
                assert "report.html: Permission denied" in said.stderr
                assert "--out" in said.stderr
            else:
                assert said.returncode == 0, said.stderr
                assert "history.rows" in said.stdout + said.stderr
    finally:
        path.chmod(0o755)
    assert (path.parent / "r.html").is_file()
    assert sorted(one.name for one in path.iterdir()) == ["journal.copy.jsonl", "journal.jsonl", "machine.toml", "taps"]


UNSURE = DISPUTED.replace('"disputed"', '"unsure"').replace("depth_mm = 4.55", "depth_mm = 3.8")
"""Between the lowest draws and the middle."""


@pytest.mark.parametrize(
    ("program", "word", "light"), [(DISPUTED, Stability.NOT_STABLE, "alarm"), (UNSURE, Stability.DOUBTFUL, "warn")]
)
def test_one_program_has_one_verdict_in_every_place(
    shop: Shop, path: Path, program: str, word: Stability, light: str
) -> None:
    shop.put(program)
    shop.tap(0, 1541.74)
    shop.tap(0.1, 1541.74, "y")
    logbook = Logbook.open(path)
    assembly = logbook.assembly()
    (name,) = (table.name for table in logbook.machine.program)
    for cut in logbook.machine.cuts("reference")[name]:
        assert zero_order_lobes(assembly.x, assembly.y, cut, np.array([16000.0])).depth[0] > 4.55e-3
    (found,) = logbook.verdicts()
    assert (found.stability, found.limit < 4.55e-3) == (word, True)
    (checked,) = json.loads(run("check", path, "--json").stdout)["programs"]
    assert (checked["name"], checked["verdict"], checked["stable"]) == (name, str(word), word is Stability.DOUBTFUL)
    (charted,) = json.loads(run("lobes", path, "--cut", name, "--json").stdout)["programs"]
    assert (charted["verdict"], charted["limit_mm"]) == (checked["verdict"], checked["limit_mm"])
    (mark,) = compare_lobes(logbook, None, name, DynamicsSource.MODES, LobeMethod.ZERO_ORDER).verdicts
    assert mark.stability is word
    ruling = (logbook.history.rows[-1].verdicts or {})[name]
    assert ruling.stability is word
    assert ruling.limit == pytest.approx(checked["limit_mm"] / 1e3)
    stored = HistoryCache(logbook.folder).read(logbook.files).rows[-1]
    assert [one.stability for one in (stored.verdicts or {}).values()] == [word]
    html = render_report(logbook, "reference", "x")
    style = VERDICT_STYLES[word].css_class
    assert len(re.findall(rf'<th scope="row">{name}</th><td class="{style}">. {word}</td>', html)) == 1
    assert f"<td>{checked['limit_mm']:.2f}" in html
    (remark,) = logbook.status(START).remarks
    assert (remark.code, remark.about) == (f"program-{word.replace(' ', '-')}", name)
    outcome = build_outcome(logbook, logbook.measurement(logbook.newest_tap().id))
    assert any(name in text and str(word) in text for text in outcome.texts)
    assert (outcome.status, "Logbook.verdicts" in outcome.next_step) == (light, True)
    (row,) = fleet_rows(Fleet({"m": path}).assess_machines())
    assert (name in row["note"] and str(word) in row["note"], row["light"]) == (True, light)
    (told,) = json.loads(run("check", path, "--json").stdout)["programs"]
    assert told == checked


def test_an_old_tap_of_the_other_direction_counts(shop: Shop) -> None:
    shop.tap(0, 1713.0)
    shop.tap(30, 1560.0)
    shop.tap(400, 1700.0, "y")
    logbook = shop.logbook
    assembly = logbook.assembly()
    assert [round(modes[0].frequency) for modes in (assembly.x, assembly.y)] == [1560, 1700]
    for found in logbook.verdicts():
        program = build_program(found.program, logbook.machine)
        limit = program_limit(program, assembly.x, assembly.y, found.samples.cuts).limit
        assert found.limit == pytest.approx(limit)
        assert found.remarks[0].code == "older-direction"
        assert re.search(r"\bx\b.* 2026-02-14.* 370 days", found.remarks[0].text)


def test_an_older_direction_falls_with_the_newer_one(shop: Shop) -> None:
    shop.tap(0, 1713.0)
    shop.tap(0.1, 1690.0, "y")
    shop.tap(100, 1713.0 * 0.98)
    shop.tap(300, 1713.0 * 0.95)
    assembly = shop.logbook.assembly()
    assert assembly.x[0].frequency == pytest.approx(1713.0 * 0.95, rel=1e-4)
    assert assembly.y[0].frequency == pytest.approx(1690.0 * 0.95, rel=1e-4)
    assert assembly.y[0].stiffness == pytest.approx(3.5e7, rel=1e-3)
    (remark,) = [one for one in assembly.remarks if one.code == "older-direction"]
    assert re.search(r"300 days.* -5\.0 %.* x\b", remark.text)
    both_tapped = shop.logbook.verdicts()[0].limit
    shop.tap(300.1, 1690.0 * 0.95, "y")
    assert shop.logbook.verdicts()[0].limit == pytest.approx(both_tapped, rel=1e-3)


def test_the_status_is_that_of_the_worst_series_not_of_the_newest_tap(path: Path) -> None:
    for days, frequency in ((0, 1713.0), (30, 1620.0), (60, 1520.0)):
        tap(path, days, frequency)
    tap(path, 61, 1400.0, tool="another")
    standing = Logbook.open(path).status(START + timedelta(days=62))
    assert standing.status == "alarm"
    assert standing.remarks[0].code == "frequency-alarm"
    assert standing.remarks[0].about == "reference, x"
    assert [series.name for series in standing.series] == ["reference, x", "another, x"]
    assert standing.series[0].drop.value == pytest.approx(100 * (1 - 1520 / 1713), abs=0.01)


def test_status_report_and_history_have_one_formula_for_the_fall(path: Path) -> None:
    tap(path, 0, 1713.0)
    tap(path, 30, 1680.0)
    logbook = Logbook.open(path)
    (series,) = logbook.status(START).series
    page = render_report(logbook, "reference", "x").replace("\N{NO-BREAK SPACE}", " ")
    assert f"<td>{change_text(series)}</td>" in page


def test_only_the_newest_row_pays_for_its_verdicts(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Program] = []

    def counting(
        program: Program, x: TipModes, y: TipModes, cuts: Sequence[Cut], vectors: ArrayLike | None = None
    ) -> ProgramLimit:
        asked.append(program)
        return program_limit(program, x, y, cuts, vectors)

    monkeypatch.setattr(lobes, "program_limit", counting)
    for day in range(5):
        tap(path, day, 1713.0 - day)
    tap(path, 4.1, 1690.0, "y")
    rows = Logbook.open(path).history.rows
    assert len(asked) == 3
    assert [row.verdicts is None for row in rows] == [True] * 5 + [False]
    asked.clear()
    assert Logbook.open(path).status(START + timedelta(days=5)).status == "good"
    assert not asked


def test_older_rows_are_evaluated_on_demand_and_kept(shop: Shop) -> None:
    for days, share in ((0, 1.0), (30, 0.95), (60, 0.9)):
        shop.tap_both(days, share)
    logbook = shop.logbook
    first, last = logbook.taps[1].id, logbook.taps[-1].id
    assert [ruling.stability for ruling in logbook.stored_verdicts(first).values()] == [Stability.STABLE] * 3
    assert [ruling.stability for ruling in logbook.stored_verdicts(last).values()].count(Stability.NOT_STABLE) == 2
    kept = [row.verdicts is not None for row in shop.logbook.history.rows]
    assert kept == [False, True, False, False, False, True]


def test_a_program_is_evaluated_once_in_an_opened_logbook(shop: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def counting(table: ProgramTable, *known: Any) -> Verdict:
        asked.append(table.name)
        return evaluate_program(table, *known)

    monkeypatch.setattr("lobewatch.cuts.learning.program_learning.evaluate_program", counting)
    shop.tap_both()
    logbook = shop.logbook
    words = [found.stability for found in logbook.verdicts()]
    logbook.status(START)
    (one,) = logbook.verdicts(names=["B"])
    assert (asked, one.stability, one.program.name) == (["A", "B", "C"], words[1], "B")
    again = logbook.folder.read(logbook.newest_tap())
    logbook.commit(replace(again, id=f"{again.id}-2", circumstances=replace(again.circumstances, operator="Kim")))
    logbook.verdicts()
    assert asked == ["A", "B", "C"] * 2


def test_reading_again_writes_nothing_with_or_without_programs(path: Path, tmp_path: Path) -> None:
    make_machine_folder(tmp_path / "plain", "new_machine.toml")
    for folder in (path, tmp_path / "plain"):
        tap(folder, 0, 1713.0)
        Logbook.open(folder).status()
        before = (folder / "history.rows").stat().st_mtime_ns
        Logbook.open(folder).status()
        assert (folder / "history.rows").stat().st_mtime_ns == before


def test_rows_are_kept_up_to_the_first_that_differs(path: Path, analysed: list[str]) -> None:
    for day in (0, 10, 20):
        tap(path, day, 1713.0 - day)
    Logbook.open(path).status()
    analysed.clear()
    tap(path, 15, 1700.0)
    rows = Logbook.open(path).history.rows
    assert [round(row.frequency.value) for row in rows] == [1713, 1703, 1700, 1693]
    assert len(analysed) == 2


def test_another_depth_analyses_nothing_and_keeps_the_words_on_other_programs(path: Path, analysed: list[str]) -> None:
    tap(path, 0, 1713.0)
    before = Logbook.open(path).history.rows[0]
    analysed.clear()
    text = (path / "machine.toml").read_text()
    assert len(before.verdicts or ()) == len(Logbook.open(path).machine.program) == 3
    (path / "machine.toml").write_text(re.sub(r"(?m)^depth_mm = [0-9.]+", "depth_mm = 0.01", text, count=1))
    logbook = Logbook.open(path)
    (kept,) = HistoryCache(logbook.folder).read(logbook.files).rows
    changed, *others = [table.name for table in logbook.machine.program]
    assert {name: (before.verdicts or {})[name] for name in others} == kept.verdicts
    assert logbook.stored_verdicts(before.tap_id)[changed].stability is not Stability.NOT_STABLE
    assert list(logbook.stored_verdicts(before.tap_id)) == [changed, *others]
    assert analysed == [before.tap_id]  # to judge the program that has changed


def of_fewer_fields(rows: list[bytes]) -> list[bytes]:
    return [rows[0], *(msgspec.msgpack.encode(msgspec.msgpack.decode(row)[:-5]) for row in rows[1:])]


def of_another_version(rows: list[bytes]) -> list[bytes]:
    return [rows[0] + b".1", *rows[1:]]


@pytest.mark.parametrize("older", [of_fewer_fields, of_another_version])
def test_a_history_of_another_make_is_made_again(
    path: Path, analysed: list[str], older: Callable[[list[bytes]], list[bytes]]
) -> None:
    tap(path, 0, 1713.0)
    expected = Logbook.open(path).history.rows[0]
    write_rows(path / "history.rows", older(list(read_rows(path / "history.rows").rows)))
    analysed.clear()
    assert Logbook.open(path).history.rows[0].frequency == expected.frequency
    assert len(analysed) == 1


def test_replay_answers_with_the_measurement_and_stores_once(path: Path, beam: Path) -> None:
    logbook = Logbook.open(path)
    found = logbook.replay(beam, date=START)
    assert (found.time, len(found.modes) >= 4) == (START, True)
    assert logbook.replay(beam).tap_id == found.tap_id
    assert [entry.id for entry in Logbook.open(path).series("reference", "x")] == [found.tap_id]
    with pytest.raises(KeyError):
        logbook.measurement("nothing")


def test_somebody_elses_tap_is_noticed(path: Path) -> None:
    logbook = Logbook.open(path)
    assert logbook.is_current
    tap(path, 0, 1713.0)
    assert not logbook.is_current
    mine = Logbook.open(path)
    mine.commit(logbook.folder.read(mine.newest_tap()))
    assert mine.is_current


def damage(path: Path, tap_id: str) -> None:
    with (path / "taps" / f"{tap_id}.h5").open("ab") as file:
        file.write(b"x")


def test_a_damaged_tap_is_called_so_and_no_wrong_label_is_kept(path: Path) -> None:
    tap(path, 0, 1713.0)
    tap(path, 30, 1541.74)
    logbook = Logbook.open(path)
    expected = [found.stability for found in logbook.verdicts()]
    sound = (path / "taps" / f"{logbook.taps[1].id}.h5").read_bytes()
    (path / "history.rows").unlink()
    damage(path, logbook.taps[1].id)
    rest = Logbook.open(path)
    assert rest.stored_verdicts(rest.taps[0].id) == {one.program.name: one.stored for one in rest.verdicts()}
    assert {found.stability for found in rest.verdicts()} <= {Stability.DOUBTFUL, Stability.NOT_STABLE}
    (row,) = fleet_rows(Fleet({"m": path}).assess_machines())
    assert f"{len(sound) + 1} bytes" in row["note"]
    (path / "taps" / f"{logbook.taps[1].id}.h5").write_bytes(sound)
    assert [ruling.stability for ruling in Logbook.open(path).stored_verdicts(logbook.taps[1].id).values()] == expected


def test_a_machine_that_disappears_does_not_hide_the_others(path: Path, tmp_path: Path) -> None:
    make_machine_folder(tmp_path / "n", "surrogate_machine.toml")
    tap(path, 0, 1713.0)
    plant = Fleet({name: tmp_path / name for name in ("m", "n")})
    (tmp_path / "n" / "machine.toml").unlink()
    assert {row["key"]: row["light"] for row in fleet_rows(plant.assess_machines())} == {"n": "unknown", "m": "warn"}


def test_a_lost_mode_does_not_hide_an_alarm(path: Path) -> None:
    for days, frequency in ((0, 1713.0), (30, 1620.0), (60, 1520.0), (90, 900.0)):
        tap(path, days, frequency)
    standing = Logbook.open(path).status(START + timedelta(days=91))
    assert standing.status == "alarm"
    assert {"frequency-alarm", "mode-lost"} <= {remark.code for remark in standing.remarks}


def test_the_report_of_an_older_series_stands_on_what_is_known_now(path: Path) -> None:
    tap(path, 0, 1713.0)
    tap(path, 1, 1690.0, "y")
    tap(path, 2, 1650.0, tool="another")
    html = render_report(Logbook.open(path), "reference", "x")
    assert "x and y directions" in html


def test_a_program_is_charted_with_its_own_tool(path: Path) -> None:
    tap(path, 0, 1713.0)
    tap(path, 1, 1650.0, tool="another")
    said = json.loads(run("lobes", path, "--cut", "A", "--json").stdout)
    assert [program["name"][0] for program in said["programs"]] == ["A", "B", "C"]
