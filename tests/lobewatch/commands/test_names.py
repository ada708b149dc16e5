"""Names given by users: shown unchanged, or rejected with one clear error."""

from __future__ import annotations

import csv
import gzip
import io
import json
import re
import sqlite3
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

import duckdb
import numpy as np
import pytest

from acquisition import Circumstances, TapTest, from_accelerance, new_tap_id
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from modal import Mode, synthesize_frf
from tests.lobewatch.commands.conftest import Run

LINES = np.arange(4.0, 4000.0, 4.0)
FORMULA = r"cost $5 \frac to $6"
"""To matplotlib a broken formula."""
CLEAR = "\x1b[2J"
"""Clears a terminal."""
RUNS = "=cmd|' /C calc'!A0"
"""Starts a program, where a spreadsheet takes it for a formula."""


@pytest.fixture
def folder(tmp_path: Path) -> MachineFolder:
    """Make the example machine with formula-like names and one tap test."""
    make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    toml = tmp_path / "m" / "machine.toml"
    text = toml.read_text("utf-8").replace("high_rpm = 24000", "high_rpm = 24000\nsteps = 300")
    for old in ('"m"', '"A: slot at 12 600 rpm"'):
        assert old in text
        text = text.replace(old, f"'{FORMULA}'")
    toml.write_text(text, "utf-8")
    made = MachineFolder(tmp_path / "m")
    tap(made, Circumstances(FORMULA, datetime(2026, 1, 15, tzinfo=UTC), "reference", machine_toml=text))
    return made


def tap(folder: MachineFolder, about: Circumstances) -> None:
    frf = synthesize_frf([Mode(1713.0, 0.029, 3.5e7)], LINES)
    folder.commit(TapTest(new_tap_id(about), about, from_accelerance(LINES, frf.accelerance)))


def test_names_like_formulas_stand_in_report_pictures_and_tables(run: Run, folder: MachineFolder) -> None:
    report = run("report", "m")
    assert report.code == 0, report.err
    html = (folder.path / "report.html").read_text("utf-8")
    assert html.count(FORMULA) >= 3
    assert f">{FORMULA}</text>" in html
    for option in ("--figure", "--radial", "--waterfall"):
        said = run("lobes", "m", option, "picture.svg")
        assert said.code == 0, said.err
        assert f">{FORMULA}: reference cut</text>" in Path("picture.svg").read_text("utf-8")
    assert run("model", "m", "--figure", "model.svg").code == 0
    assert FORMULA in run("check", "m").out
    assert json.loads(run("check", "m", "--json").out)["programs"][0]["name"] == FORMULA


def test_no_name_runs_in_a_spreadsheet(run: Run, folder: MachineFolder) -> None:
    """In tables with commas; for programs it stays as it is."""
    toml = folder.path / "machine.toml"
    toml.write_text(toml.read_text("utf-8").replace(f"'{FORMULA}'", f'"{RUNS}"'), "utf-8")
    tap(folder, Circumstances("m", datetime(2026, 2, 15, tzinfo=UTC), "-tool", machine_toml=toml.read_text("utf-8")))
    assert run("event", "m", "+1 bearing").code == 0
    for name in ("fleet.csv", "fleet.csv.gz", "fleet.sqlite", "fleet.parquet"):
        assert run("export", ".", name).code == 0
    (first, second) = csv.DictReader(io.StringIO(Path("fleet.csv").read_text("utf-8")))
    assert (first["machine"], second["tool"]) == (f"'{RUNS}", "'-tool")
    assert gzip.decompress(Path("fleet.csv.gz").read_bytes()) == Path("fleet.csv").read_bytes()
    (line,) = csv.DictReader(io.StringIO(run("status", ".", "--csv").out))
    assert line["name"] == f"'{RUNS}"
    lines = [*csv.DictReader(io.StringIO(run("history", "m", "--csv").out))]
    assert [(line["kind"], line["tool"], line["text"]) for line in lines[1:]] == [
        ("tap", "'-tool", ""),
        ("event", "", "'+1 bearing"),
    ]
    with closing(sqlite3.connect("fleet.sqlite")) as base, closing(duckdb.connect()) as other:
        names = {(RUNS, "reference"), (RUNS, "-tool")}
        assert {*base.execute("SELECT machine, tool FROM taps")} == names
        assert {*other.sql("SELECT machine, tool FROM 'fleet.parquet'").fetchall()} == names


@pytest.mark.parametrize(
    "name",
    ['3/8" mill', "cost $5 to $6", r"C:\mills", "Fräse ø 20, 主轴", "[/bold] mill", "a 'b' \"c\"", "ends in \\"],
)
def test_init_keeps_the_name_of_the_machine_and_of_a_folder_that_windows_can_store(run: Run, name: str) -> None:
    place = re.sub(r'[<>:"|?*\\/]', "_", name)
    said = run("init", place)
    assert said.code == 0, said.err
    assert f"{Path(place)}/machine.toml" in said.out
    assert MachineFolder(place).machine.machine.name == place
    assert json.loads(run("init", f"{place} 2", "--name", name, "--json").out)["machine"] == f"{place} 2"
    assert MachineFolder(f"{place} 2").machine.machine.name == name


@pytest.mark.parametrize("name", [f"mill{CLEAR}", "two\nlines", "tab\tbed", "bell\x07", "csi\x9b2J", "half\udce4"])
def test_init_rejects_a_folder_that_steers_a_terminal(run: Run, name: str) -> None:
    said = run("init", name)
    assert (said.code, said.out) == (2, "")
    assert said.err.startswith("error: folder='")
    assert said.err.isprintable() or said.err[:-1].isprintable()
    assert list(Path.cwd().iterdir()) == []


@pytest.mark.parametrize(
    "command",
    [
        ("init",),
        ("init", "--example"),
        ("sensors",),
        ("tap", "--port", "x"),
        ("model",),
        ("calibrate", "--frequency", "1700"),
        ("lobes",),
        ("check",),
        ("report",),
        ("serve",),
        ("emulate", "taps"),
        ("emulate", "dataq"),
        ("replay",),
    ],
)
def test_an_empty_name_of_a_folder_is_rejected(run: Run, folder: MachineFolder, command: tuple[str, ...]) -> None:
    before = sorted(Path.cwd().rglob("*"))
    said = run(*command, "", *(["x.csv"] if command == ("replay",) else []))
    assert (said.code, said.out) == (2, "")
    assert said.err.startswith("error: ")
    assert said.err.count("\n") == 1
    assert "empty" in said.err
    assert sorted(Path.cwd().rglob("*")) == before


def test_the_current_folder_is_named_by_a_dot(run: Run, tmp_path: Path) -> None:
    assert run("init", ".").code == 0
    assert MachineFolder(".").machine.machine.name == tmp_path.name
    with pytest.raises(FileNotFoundError, match="empty"):
        MachineFolder("")


@pytest.mark.parametrize("character", ["\x1b", "\0", "\n", "\t", "\x7f", "\x9b", "\u2028"])
def test_an_operator_or_tool_with_control_characters_is_not_kept(
    run: Run, folder: MachineFolder, character: str
) -> None:
    recording = folder.path / "taps" / f"{folder.taps()[0].id}.h5"
    assert run("init", "other").code == 0
    said = run("replay", "other", recording, "--tool", f"mill{character}")
    assert (said.code, said.out) == (2, "")
    assert "error: tool='mill" in said.err
    assert character not in said.err.removesuffix("\n")
    assert MachineFolder("other").taps() == []
    about = Circumstances("m", datetime(2026, 1, 15, tzinfo=UTC), operator=f"K{character}im")
    with pytest.raises(ValueError, match=r"operator='K.*im'"):
        new_tap_id(about)


def test_nothing_of_a_foreign_file_steers_the_terminal(run: Run, tmp_path: Path) -> None:
    file = tmp_path / f"hit{CLEAR}.csv"
    file.write_text(f"time_s,acc{CLEAR}\x07_g,other\n" + "".join(f"{i},1,2\n" for i in range(9)), encoding="utf-8")
    said = run("modes", file)
    assert said.code == 2
    assert "hit\ufffd[2J.csv: " in said.err
    assert "acc\ufffd[2J [g], other" in said.err
    assert not any(character in said.err for character in "\x1b\x07")


def test_the_name_of_a_recording_is_exact_in_json_and_harmless_elsewhere(run: Run, beam: Path, tmp_path: Path) -> None:
    file = tmp_path / f"a{CLEAR}\x9bä.lvm"
    file.write_bytes(beam.read_bytes())
    said = run("modes", file, "--figure", "picture.svg")
    assert said.code == 0, said.err
    assert "a\ufffd[2J\ufffdä.lvm: " in said.out
    assert "\x1b" not in Path("picture.svg").read_text("utf-8")
    exact = run("modes", file, "--json").out
    assert json.loads(exact)["file"] == str(file)
    assert not set("\x1b\x9b") & set(exact)
