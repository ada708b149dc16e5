"""The logbook: every tap test analysed once, readers that disturb nobody, one verdict in every place."""

from __future__ import annotations

import ctypes
import json
import os
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from acquisition import Circumstances, DataError, TapDirection, TapTest, from_accelerance, new_tap_id
from lobes import Program, ProgramLimit, program_limit, read_history, write_history, zero_order
from lobewatch import Logbook
from lobewatch.analysis import Measurement, Word, compare_lobes, measure
from lobewatch.analysis.charts import Dynamics, Method
from lobewatch.cli import app
from lobewatch.machine import Machine, MachineFolder
from lobewatch.machine.new_folder import make_machine_folder
from lobewatch.screen.dashboard import Board
from lobewatch.show.report import render_report
from lobewatch.tap.outcome import outcome_of
from modal import Mode, synthesize

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
depth_mm = 22
"""
"""design/verdict.md: 29.5 mm and stable by zero order, 17.5 mm and not stable by semi-discretisation."""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """The example machine, with few speeds."""
    make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    toml = tmp_path / "m" / "machine.toml"
    toml.write_text(toml.read_text("utf-8").replace("high_rpm = 24000", "high_rpm = 24000\nsteps = 200"), "utf-8")
    return tmp_path / "m"


def add_programs(path: Path, text: str) -> None:
    toml = path / "machine.toml"
    head, mark, tail = toml.read_text("utf-8").partition("# The spindle of the example")
    toml.write_text(f"{head}{text}\n{mark}{tail}", "utf-8")


def tap(path: Path, days: float, frequency: float, direction: TapDirection = "x", tool: str = "reference") -> None:
    folder = MachineFolder(path)
    about = Circumstances("m", START + timedelta(days=days), tool, direction, "", folder.toml.read_text("utf-8"))
    frf = synthesize([Mode(frequency, 0.029136, 3.48e7)], LINES)
    folder.commit(TapTest(new_tap_id(about), about, from_accelerance(LINES, frf.accelerance)))


def run(*arguments: object) -> Result:
    return CliRunner().invoke(app, [*map(str, arguments)], catch_exceptions=False)


@pytest.fixture
def analysed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Identities of the tap tests analysed from now on."""
    found: list[str] = []

    def counting(tap: TapTest, machine: Machine, last: Mode | None = None) -> Measurement:
        found.append(tap.id)
        return measure(tap, machine, last)

    monkeypatch.setattr("lobewatch.analysis.logbook.measure", counting)
    return found


@pytest.mark.parametrize(
    ("command", "most"), [("check", 4), ("lobes", 4), ("report", 4), ("model", 1)], ids=lambda value: str(value)
)
def test_no_command_analyses_a_tap_twice(path: Path, analysed: list[str], command: str, most: int) -> None:
    table = DISPUTED.partition('name = "disputed"')[2]
    add_programs(path, "".join(f'[[program]]\nname = "P{i}"{table}' for i in range(17)))
    for month in range(3):
        tap(path, 30 * month, 1713.0 - 10 * month)
        tap(path, 30 * month + 0.1, 1690.0 - 10 * month, "y")
    assert len(Logbook.open(path).history.rows) == 6
    assert Counter(analysed).most_common(1)[0][1] == 1
    analysed.clear()
    run(command, path)
    assert len(analysed) == len(set(analysed)) <= most


def test_a_reader_beside_a_writer_reads_on_and_writes_nothing(path: Path) -> None:
    tap(path, 0, 1713.0)
    Logbook.open(path).standing()
    before = (path / "history.h5").read_bytes()
    with MachineFolder(path).locked():
        tap(path, 30, 1690.0)
        said = run("check", path, "--json")
        shown = run("lobes", path)
    assert json.loads(said.stdout)["programs"][0]["tap_id"].startswith("20260214")
    assert "history.h5: not brought up to date on the disk, worked out in memory" in shown.stdout
    assert (path / "history.h5").read_bytes() == before
    assert "in memory" not in run("lobes", path).stdout
    assert (path / "history.h5").read_bytes() != before


def without_override() -> None:
    """Make file permissions count for root too (PR_CAPBSET_DROP, CAP_DAC_OVERRIDE)."""
    if os.geteuid() == 0:
        ctypes.CDLL(None).prctl(24, 1)


@pytest.mark.skipif(sys.platform != "linux", reason="drops a capability of Linux")
def test_a_folder_that_cannot_be_written_is_read(path: Path) -> None:
    tap(path, 0, 1713.0)
    path.chmod(0o555)
    try:
        for name, *options in (["check"], ["lobes"], ["report", "--out", str(path.parent / "r.html")], ["report"]):
            command = [sys.executable, "-m", "lobewatch.cli", name, str(path), *options]
            said = subprocess.run(command, capture_output=True, text=True, preexec_fn=without_override, check=False)
            if (name, options) == ("report", []):
                assert said.returncode == 2
                assert "report.html: Permission denied; name another file with --out" in said.stderr
            else:
                assert said.returncode == 0, said.stderr
                assert "worked out in memory" in said.stdout + said.stderr
    finally:
        path.chmod(0o755)
    assert (path.parent / "r.html").is_file()
    assert sorted(one.name for one in path.iterdir()) == ["journal.jsonl", "machine.toml", "taps"]


def test_one_program_has_one_word_in_every_place(path: Path) -> None:
    add_programs(path, DISPUTED)
    tap(path, 0, 1541.74)
    logbook = Logbook.open(path)
    assembly = logbook.assembly()
    cut = logbook.machine.cuts("reference")["disputed"]
    assert zero_order(assembly.x, None, cut, np.array([16000.0])).depth[0] > 22e-3
    (found,) = (one for one in logbook.verdicts() if one.program.name == "disputed")
    assert (found.word, found.limit < 22e-3) == (Word.NOT_STABLE, True)
    checked = json.loads(run("check", path, "--json").stdout)["programs"][-1]
    assert (checked["name"], checked["verdict"], checked["stable"]) == ("disputed", "not stable", False)
    (charted,) = json.loads(run("lobes", path, "--cut", "disputed", "--json").stdout)["programs"]
    assert (charted["verdict"], charted["limit_mm"]) == (checked["verdict"], checked["limit_mm"])
    (mark,) = compare_lobes(logbook, None, "disputed", Dynamics.MODES, Method.ZERO_ORDER).verdicts
    assert mark.word is Word.NOT_STABLE
    ruling = (logbook.history.rows[-1].rulings or {})["disputed"]
    assert ruling.word is Word.NOT_STABLE
    assert ruling.limit == pytest.approx(checked["limit_mm"] / 1e3)
    assert read_history(path / "history.h5").columns["program_verdict"][0].split("\n")[-1] == "not stable"
    html = render_report(logbook, "reference", "x")
    assert "disputed: not stable" in html[: html.index("<table>")]
    assert f"<td>{checked['limit_mm']:.2f}" in html
    standing = logbook.standing(START)
    assert "disputed" in [remark.about for remark in standing.remarks if remark.code == "program-not-stable"]
    told = outcome_of(logbook, logbook.measurement(logbook.newest().id)).texts
    assert any("disputed: not stable." in text for text in told)
    (row,) = Board({"m": MachineFolder(path)}).rows()
    assert (row["light"], "disputed: not stable" in row["note"]) == ("alarm", True)


def test_an_old_tap_of_the_other_direction_counts(path: Path) -> None:
    tap(path, 0, 1713.0)
    tap(path, 30, 1560.0)
    alone = {one.program.name: one.limit for one in Logbook.open(path).verdicts()}
    tap(path, 400, 1700.0, "y")
    logbook = Logbook.open(path)
    both = {one.program.name: one.limit for one in logbook.verdicts()}
    assert all(both[name] < alone[name] for name in alone)
    assert [remark.code for remark in logbook.verdicts()[0].remarks] == ["older-direction"]


def test_the_light_is_that_of_the_worst_series_not_of_the_newest_tap(path: Path) -> None:
    for days, frequency in ((0, 1713.0), (30, 1620.0), (60, 1520.0)):
        tap(path, days, frequency)
    tap(path, 61, 1400.0, tool="another")
    standing = Logbook.open(path).standing(START + timedelta(days=62))
    assert standing.light == "alarm"
    assert standing.remarks[0].code == "frequency-alarm"
    assert standing.remarks[0].about == "reference, x"
    assert [series.name for series in standing.series] == ["reference, x", "another, x"]
    assert standing.series[0].fall.value == pytest.approx(100 * (1 - 1520 / 1713), abs=0.01)


def test_light_report_and_history_have_one_formula_for_the_fall(path: Path) -> None:
    tap(path, 0, 1713.0)
    tap(path, 30, 1680.0)
    logbook = Logbook.open(path)
    (series,) = logbook.standing(START).series
    assert f"<td>{-series.fall.value:+.2f} %</td>" in render_report(logbook, "reference", "x")


def test_only_the_newest_row_pays_for_its_verdicts(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Program] = []

    def counting(program: Program, *modes: Sequence[Mode] | None) -> ProgramLimit:
        asked.append(program)
        return program_limit(program, *modes)

    monkeypatch.setattr("lobewatch.analysis.programs.verdict.program_limit", counting)
    for day in range(6):
        tap(path, day, 1713.0 - day)
    rows = Logbook.open(path).history.rows
    assert len(asked) == 3
    assert [row.rulings is None for row in rows] == [True] * 5 + [False]
    asked.clear()
    assert Logbook.open(path).standing(START).light == "good"
    assert not asked


def test_older_rows_are_judged_on_demand_and_kept(path: Path) -> None:
    tap(path, 0, 1713.0)
    tap(path, 30, 1620.0)
    tap(path, 60, 1541.74)
    logbook = Logbook.open(path)
    first, _, last = (entry.id for entry in logbook.taps)
    assert [ruling.word for ruling in logbook.rulings(first).values()] == [Word.STABLE] * 3
    assert [ruling.word for ruling in logbook.rulings(last).values()].count(Word.NOT_STABLE) == 2
    kept = [row.rulings is not None for row in Logbook.open(path).history.rows]
    assert kept == [True, False, True]


def test_reading_again_writes_nothing_with_or_without_programs(path: Path, tmp_path: Path) -> None:
    make_machine_folder(tmp_path / "plain", "new_machine.toml")
    for folder in (path, tmp_path / "plain"):
        tap(folder, 0, 1713.0)
        Logbook.open(folder).standing()
        before = (folder / "history.h5").stat().st_ino
        Logbook.open(folder).standing()
        assert (folder / "history.h5").stat().st_ino == before


def test_rows_are_kept_up_to_the_first_that_differs(path: Path, analysed: list[str]) -> None:
    for day in (0, 10, 20):
        tap(path, day, 1713.0 - day)
    Logbook.open(path).standing()
    analysed.clear()
    tap(path, 15, 1700.0)
    rows = Logbook.open(path).history.rows
    assert [round(row.frequency.value) for row in rows] == [1713, 1703, 1700, 1693]
    assert len(analysed) == 2


def test_a_history_of_another_make_is_made_anew(path: Path, analysed: list[str]) -> None:
    tap(path, 0, 1713.0)
    expected = Logbook.open(path).history.rows[0]
    stored = read_history(path / "history.h5")
    assert {"tap_id", "frequency_std", "notes", "program_limit", "mode_stiffness"} <= stored.columns.keys()
    older = {name: values for name, values in stored.columns.items() if name != "remarks"}
    object.__setattr__(stored, "columns", older)
    write_history(path / "history.h5", stored)
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
    mine.commit(logbook.folder.read(mine.newest()))
    assert mine.is_current


def damage(path: Path, tap_id: str) -> None:
    with (path / "taps" / f"{tap_id}.h5").open("ab") as file:
        file.write(b"x")


def test_a_damaged_tap_is_called_so_and_no_wrong_word_is_kept(path: Path) -> None:
    tap(path, 0, 1713.0)
    tap(path, 30, 1541.74)
    logbook = Logbook.open(path)
    expected = [found.word for found in logbook.verdicts()]
    sound = (path / "taps" / f"{logbook.taps[1].id}.h5").read_bytes()
    (path / "history.h5").unlink()
    damage(path, logbook.taps[1].id)
    with pytest.raises(DataError, match="altered since it was written"):
        Logbook.open(path).verdicts()
    (row,) = Board({"m": MachineFolder(path)}).rows()
    assert (row["light"], "altered since it was written" in row["note"]) == ("unknown", True)
    (path / "taps" / f"{logbook.taps[1].id}.h5").write_bytes(sound)
    assert [ruling.word for ruling in Logbook.open(path).rulings(logbook.taps[1].id).values()] == expected


def test_a_machine_that_disappears_does_not_hide_the_others(path: Path, tmp_path: Path) -> None:
    make_machine_folder(tmp_path / "n", "surrogate_machine.toml")
    tap(path, 0, 1713.0)
    board = Board({name: MachineFolder(tmp_path / name) for name in ("m", "n")})
    (tmp_path / "n" / "machine.toml").unlink()
    assert {row["key"]: row["light"] for row in board.rows()} == {"n": "unknown", "m": "warn"}


def test_a_lost_mode_does_not_hide_an_alarm(path: Path) -> None:
    for days, frequency in ((0, 1713.0), (30, 1620.0), (60, 1520.0), (90, 900.0)):
        tap(path, days, frequency)
    standing = Logbook.open(path).standing(START + timedelta(days=91))
    assert standing.light == "alarm"
    assert {"frequency-alarm", "mode-lost"} <= {remark.code for remark in standing.remarks}


def test_the_report_of_an_older_series_stands_on_what_is_known_now(path: Path) -> None:
    tap(path, 0, 1713.0)
    tap(path, 1, 1690.0, "y")
    tap(path, 2, 1650.0, tool="another")
    html = render_report(Logbook.open(path), "reference", "x")
    assert "x and y directions" in html
    assert "modes in the x direction alone" not in html


def test_a_recommended_depth_is_stable_when_it_is_entered(path: Path) -> None:
    tap(path, 0, 1541.74)
    depth = re.search(r"A: .* cut no deeper than (\d+\.\d\d) mm", run("check", path).stdout)
    assert depth is not None
    toml = path / "machine.toml"
    toml.write_text(toml.read_text("utf-8").replace("depth_mm = 6.0", f"depth_mm = {depth[1]}"), "utf-8")
    assert Logbook.open(path).verdicts()[0].word is Word.STABLE


def test_a_program_is_charted_with_its_own_tool(path: Path) -> None:
    tap(path, 0, 1713.0)
    tap(path, 1, 1650.0, tool="another")
    said = json.loads(run("lobes", path, "--cut", "A: slot at 12 600 rpm", "--json").stdout)
    assert [program["name"][0] for program in said["programs"]] == ["A", "B", "C"]
