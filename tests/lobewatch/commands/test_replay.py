"""Folders of recordings: dated, explained before they are stored, stored once, one bad file at its own cost."""

from __future__ import annotations

import json
import re
import shutil
from datetime import date, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from acquisition import DataError, Description, Recording, inspect_file
from lobewatch.cli import app
from lobewatch.logbook.recordings.store_recordings import store_recordings
from lobewatch.show.terminal.option_names import with_option_names
from tests.lobewatch.commands.invoke import invoke

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
F = np.arange(4.0, 4000.0, 4.0)


@pytest.fixture
def shop(shop: Shop) -> Shop:
    """Without programs, which take their time."""
    shop.put("")
    return shop


def run(*arguments: object) -> Result:
    return invoke([*map(str, arguments)])


def frf(path: Path, frequency: float = 1700.0, heading: str = "Freq (Hz),Real (um/N),Imag (um/N)") -> Path:
    path.parent.mkdir(exist_ok=True)
    values = 1e6 / (3.5e7 * (1 - (F / frequency) ** 2 + 0.06j * F / frequency))
    rows = "".join(f"{f:.6g},{v.real:.9e},{v.imag:.9e}\n" for f, v in zip(F, values, strict=True))
    path.write_text(f"{heading}\n{rows}", encoding="utf-8")
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Three tests, the newest first by name, a picture, and a hidden file."""
    made = tmp_path / "Prüfung 2024"
    for name, frequency in (("a 20240901", 1690.0), ("b 20240501", 1713.0), ("ü 20240701", 1700.0)):
        frf(made / f"{name}.csv", frequency)
    (made / "picture.png").write_bytes(b"\x89PNG")
    (made / ".hidden.csv").write_text("no")
    return made


def taps(shop: Shop) -> list[str]:
    return [entry.time[:10] for entry in shop.folder.taps()]


def test_a_file_without_a_date_is_asked_for_it_with_all_else(shop: Shop, tmp_path: Path) -> None:
    path = frf(tmp_path / "x.csv", heading="Freq,Real,Imag")
    with pytest.raises(DataError, match=r"x\.csv.*Real.*--unit.*--date"):
        run("replay", shop.path, path)
    with pytest.raises(DataError, match=r"x\.csv: .*--date 2024-05-01.*--date-pattern") as refused:
        run("replay", shop.path, path, "--unit", "um/N")
    assert "--unit" not in str(refused.value)
    assert taps(shop) == []


def test_a_folder_is_stored_in_order_of_date_once(shop: Shop, folder: Path) -> None:
    said = run("replay", shop.path, folder, "--date-pattern", "%Y%m%d")
    assert "3 of 3" in said.stdout
    assert "direction x" in said.stdout
    assert taps(shop) == ["2024-05-01", "2024-07-01", "2024-09-01"]
    frequencies = [row.frequency.value for row in shop.logbook.history.rows]
    assert frequencies == pytest.approx([1713, 1700, 1690], rel=1e-3)
    shutil.copy(folder / "a 20240901.csv", folder / "again 20230101.csv")
    again = run("replay", shop.path, folder / "*.csv", "--date-pattern", "%Y%m%d")
    assert "0 of 4" in again.stdout
    assert len(taps(shop)) == 3


def test_a_dry_run_explains_and_stores_nothing(shop: Shop, folder: Path) -> None:
    before = sorted(path for path in shop.path.rglob("*") if path.is_file())
    said = json.loads(run("replay", shop.path, folder, "--date-pattern", "%Y%m%d", "--dry-run", "--json").stdout)
    assert [one["time"][:10] for one in said["files"]] == ["2024-05-01", "2024-07-01", "2024-09-01"]
    assert [Path(one).name for one in said["passed_over"]] == ["picture.png"]
    first = said["files"][0]
    facts = {fact["name"]: (fact["value"], fact["origin"]) for fact in first["facts"]}
    assert facts["unit"] == ("um/N (displacement)", "file")
    assert facts["date"][1] == "option"
    assert facts["direction"] == ("x", "default")
    assert first["followed"]["frequency_hz"] == pytest.approx(1713, rel=1e-3)
    assert [one["questions"] for one in said["files"]] == [[], [], []]
    text = run("replay", shop.path, folder, "--date-pattern", "%Y%m%d", "--dry-run").stdout
    assert "3 of 3" in text
    assert before == sorted(path for path in shop.path.rglob("*") if path.is_file())


def test_a_dry_run_says_the_same_to_every_reader(shop: Shop, folder: Path) -> None:
    shutil.copy(folder / "a 20240901.csv", folder / "twin 20240902.csv")
    (folder / "bad 20240801.csv").write_text("Freq (Hz),Real (um/N),Imag (um/N)\n1,2,3\n2,x,3\n")
    options, found = ("--date-pattern", "%Y%m%d", "--dry-run", "--json"), []
    for jobs in (1, 2):
        said = CliRunner().invoke(app, ["replay", str(shop.path), str(folder), *options, "--jobs", str(jobs)])
        found.append(json.loads(said.stdout)["files"])
        (twin,) = [one for one in found[-1] if one["file"].endswith("twin 20240902.csv")]
        assert "20240901" in twin.pop("known")  # of an identity that is made up each time
    assert found[0] == found[1]
    assert [bool(one["refused"]) for one in found[0]].count(True) == 1
    assert len(taps(shop)) == 0


def test_a_dry_run_names_the_tap_test_that_a_file_is_already(shop: Shop, folder: Path) -> None:
    run("replay", shop.path, folder / "b 20240501.csv", "--date-pattern", "%Y%m%d")
    (stored,) = shop.folder.taps()
    said = json.loads(run("replay", shop.path, folder, "--date-pattern", "%Y%m%d", "--dry-run", "--json").stdout)
    first, *others = said["files"]
    assert (Path(first["file"]).name, first["known"]) == ("b 20240501.csv", stored.id)
    assert [one["known"] for one in others] == ["", ""]


def test_a_dry_run_asks_what_the_replay_would_ask(shop: Shop, beam: Path) -> None:
    shop.edit("band_hz = [1200, 2200]", "band_hz = [1200, 1800]")
    said = json.loads(run("replay", shop.path, beam, "--dry-run", "--json").stdout)
    (one,) = said["files"]
    assert [asked["code"] for asked in one["questions"]] == ["no-mode-in-band"]
    assert one["hits"] == ["good"]


def test_one_bad_file_costs_only_itself_where_it_may(shop: Shop, folder: Path) -> None:
    bad = folder / "bad 20240801.csv"
    bad.write_text("Freq (Hz),Real (um/N),Imag (um/N)\n1,2,3\n2,x,3\n")
    (folder / "empty 20240802.txt").touch()
    options = ("--date-pattern", "%Y%m%d")
    with pytest.raises(DataError, match=r"2 of 5(.|\n)*--keep-going") as refused:
        run("replay", shop.path, folder, *options)
    assert re.search(r"bad 20240801\.csv: .*'x'.*line 3", str(refused.value))
    assert "empty 20240802.txt" in str(refused.value)
    assert taps(shop) == []
    with pytest.raises(DataError, match="2 of 5"):
        run("replay", shop.path, folder, *options, "--keep-going")
    assert len(taps(shop)) == 3


def test_where_no_file_can_be_used_nothing_is_kept_going_with(shop: Shop, tmp_path: Path) -> None:
    files = [tmp_path / name for name in ("a.csv", "b.csv")]
    for file in files:
        file.write_text(f"no recording: {file.name}", "utf-8")
    with pytest.raises(DataError, match=" 2 files"):
        run("replay", shop.path, *files, "--keep-going", "--date", "2024-05-01")
    assert shop.logbook.taps == []


def test_progress_is_lines_without_a_terminal(shop: Shop, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    said = ("replay", shop.path, folder, "--date-pattern", "%Y%m%d", "--json")
    monkeypatch.setattr("lobewatch.show.replays.FIRST_LINE_DELAY", 0.0)
    monkeypatch.setattr("lobewatch.show.replays.LINE_INTERVAL", 0.0)
    shown = run(*said)
    assert [*map(int, re.findall(r"(\d) of 3", shown.stderr))] == [0, 1, 2, 3] * 2 + [0]
    assert len(json.loads(shown.stdout)["measurements"]) == 3
    again = run(*said)
    assert "of 0" not in again.stderr
    assert len(json.loads(again.stdout)["known"]) == 3


def test_notes_next_to_recordings_are_skipped_and_rejected_by_name(shop: Shop, folder: Path) -> None:
    notes = folder / "Notizen Fräser.txt"
    notes.write_text("3 Schläge, harte Spitze\n24.05.2024\n", encoding="utf-8")
    said = run("replay", shop.path, folder, "--date-pattern", "%Y%m%d", "--dry-run", "--json").stdout
    assert [Path(one).name for one in json.loads(said)["passed_over"]] == [notes.name, "picture.png"]
    stored = run("replay", shop.path, folder, "--date-pattern", "%Y%m%d")
    assert "2 other files" in stored.stderr
    assert "Notizen" in stored.stderr
    with pytest.raises(DataError, match=r"Notizen Fräser\.txt: line 2: '24\.05\.2024'"):
        run("replay", shop.path, notes, "--date", "2024-05-24")


def test_a_column_of_complex_numbers_is_no_notes(shop: Shop, tmp_path: Path) -> None:
    (tmp_path / "taps").mkdir()
    for name, text in (("a.txt", "({:.3e}-{:.3e}j)\n"), ("b.txt", "{:.3e} - {:.3e}i\n")):
        (tmp_path / "taps" / name).write_text("".join(text.format(1e-6 * n, 2e-7 * n) for n in range(1, 60)))
    with pytest.raises(DataError, match=r"a\.txt, .*b\.txt: .*column 1.*--spacing, for example 0\.5"):
        run("replay", shop.path, tmp_path / "taps")


def test_a_directory_that_is_called_like_a_file_is_a_folder(shop: Shop, folder: Path) -> None:
    (folder / "d 20240101.csv").mkdir()
    assert "3 of 3" in run("replay", shop.path, folder, "--date-pattern", "%Y%m%d").stdout
    with pytest.raises(DataError, match=r"d 20240101\.csv: .*0 files"):
        run("replay", shop.path, folder / "d 20240101.csv", "--date-pattern", "%Y%m%d")


def test_one_bad_file_of_201_costs_only_itself(shop: Shop, tmp_path: Path) -> None:
    lines = np.arange(1600.0, 1800.0, 40.0)
    for number in range(200):
        values = 1e6 / (3.5e7 * (1 - (lines / (1713 - 0.1 * number)) ** 2 + 0.06j * lines / 1713))
        rows = "".join(f"{f:g},{v.real:.6e},{v.imag:.6e}\n" for f, v in zip(lines, values, strict=True))
        day = date(2024, 1, 1) + timedelta(days=number)
        (tmp_path / f"{day}.csv").write_text(f"Freq (Hz),Real (um/N),Imag (um/N)\n{rows}")
    bad = tmp_path / "2024-12-24.csv"
    bad.write_text("Freq (Hz),Real (um/N),Imag (um/N)\n1,2,3\n2,x,3\n")
    files, said = sorted(tmp_path.glob("*.csv")), Description(date_pattern="%Y-%m-%d")
    with shop.folder.locked():
        stored = store_recordings(shop.folder, files, said, keep_going=True)
    assert (len(stored.new_tap_ids), [*stored.rejected]) == (200, [bad])
    assert re.search(r"Real .*'x'.*line 3", stored.rejected[bad])
    assert len(taps(shop)) == 200


@pytest.mark.parametrize("length", [-1, 1])
def test_a_file_that_changes_while_it_is_read_is_rejected(
    shop: Shop, folder: Path, monkeypatch: pytest.MonkeyPatch, length: int
) -> None:
    growing = folder / "a 20240901.csv"

    def looked(path: Path, said: Description) -> Recording:
        found = inspect_file(path, said)
        if path == growing:
            content = path.read_bytes()
            path.write_bytes(content + b"8,1,1\n" if length > 0 else content[:-1])
        return found

    monkeypatch.setattr("lobewatch.logbook.recordings.recorded_files.inspect_file", looked)
    with pytest.raises(DataError, match=f"{growing.name}: "):
        run("replay", shop.path, growing, "--date-pattern", "%Y%m%d")
    with pytest.raises(DataError, match=f"{growing.name}: .*1 of 3"):
        run("replay", shop.path, folder, "--date-pattern", "%Y%m%d", "--keep-going")
    assert taps(shop) == ["2024-05-01", "2024-07-01"]


def test_a_window_is_rejected_by_a_replay_and_taken_off_by_modes(shop: Shop, tmp_path: Path) -> None:
    plain = frf(tmp_path / "plain.csv")
    windowed = tmp_path / "window.csv"
    windowed.write_text("# window: exponential 0.02 s\n" + plain.read_text())
    with pytest.raises(DataError, match=r"exponential.*0\.02 s"):
        run("replay", shop.path, windowed, "--date", "2024-05-01")
    said, ours = ("--hit-at", "0", "--json"), ("--window", "0.02", "--hit-at", "0", "--json")
    found = [
        json.loads(run("modes", path, *words).stdout)["modes"][0]["damping_ratio"]
        for path, words in ((windowed, said), (plain, ours), (plain, ("--json",)))
    ]
    assert found[0] == found[1]
    assert found[2] - found[0] == pytest.approx(1 / (0.02 * 2 * np.pi * 1700), rel=1e-2)
    with pytest.raises(ValueError, match=r"--window 0\.05.*0\.02 s"):
        run("modes", windowed, "--window", "0.05", "--hit-at", "0")
    with pytest.raises(ValueError, match="--window"):
        run("modes", plain, "--hit-at", "0")
    windowed.write_text(windowed.read_text().replace(" 0.02 s", ""))
    with pytest.raises(ValueError, match="--window"):
        run("modes", windowed, "--hit-at", "0")


def test_a_second_response_of_the_same_file_is_another_test(shop: Shop, tmp_path: Path) -> None:
    path = tmp_path / "two.csv"
    one = 1 / (3.5e7 * (1 - (F / 1700) ** 2 + 0.06j * F / 1700))
    table = np.stack([F, one.real, one.imag, 2 * one.real, 2 * one.imag], axis=1)
    np.savetxt(path, table, delimiter=",", header="Freq (Hz),Real (m/N),Imag,Real (m/N),Imag", comments="")
    common = ("--date", "2024-05-01")
    run("replay", shop.path, path, *common, "--response", 1, "--direction", "x")
    run("replay", shop.path, path, *common, "--response", 2, "--direction", "y")
    run("replay", shop.path, path, *common, "--response", 2, "--direction", "y")
    assert [entry.direction for entry in shop.folder.taps()] == ["x", "y"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["*.nothing"], "*.nothing"),
        (["empty"], "0 files"),
        (["x.csv", "--date-pattern", "%Q"], "--date-pattern '%Q'"),
        (["x.csv", "--date-pattern", "%Y%m%d"], "--date-pattern '%Y%m%d'"),
        (["x.csv", "--date-pattern", "x", "--date", "2024-01-01"], "--date"),
        (["x.csv", "--date", "2024-01-01", "--unit", "furlong"], "--unit furlong"),
    ],
)
def test_wrong_use_is_one_sentence(
    shop: Shop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    frf(tmp_path / "x.csv")
    (tmp_path / "empty").mkdir()
    with pytest.raises(ValueError, match=re.escape(message)):
        run("replay", shop.path, *arguments)


def test_convert_writes_what_modes_reads(tmp_path: Path) -> None:
    source = frf(tmp_path / "x.csv")
    said = run("convert", source, tmp_path / "x.uff", "--date", "2024-05-01", "--direction", "y")
    assert "999 lines" in said.stdout
    assert "12 digits" in said.stdout
    found = [json.loads(run("modes", path, "--json").stdout)["modes"][0] for path in (source, tmp_path / "x.uff")]
    assert found[0]["frequency_hz"] == pytest.approx(found[1]["frequency_hz"], rel=1e-8)
    assert found[0]["stiffness_n_per_m"] == pytest.approx(found[1]["stiffness_n_per_m"], rel=1e-6)


@pytest.fixture
def narrow(shop: Shop, tmp_path: Path) -> Path:
    """Twenty tests of a band that does not cover that of the machine, in files that say neither unit nor date."""
    shop.edit("band_hz = [1200, 2200]", "band_hz = [1000, 2400]")
    (tmp_path / "narrow").mkdir()
    lines = np.arange(1600.0, 1800.0, 4.0)
    for number in range(20):
        values = 1e6 / (3.5e7 * (1 - (lines / (1713 - 0.1 * number)) ** 2 + 0.06j * lines / 1713))
        rows = "".join(f"{f:g},{v.real:.9e},{v.imag:.9e}\n" for f, v in zip(lines, values, strict=True))
        (tmp_path / "narrow" / f"202401{number + 1:02d}.csv").write_text(f"Freq,Real,Imag\n{rows}")
    return tmp_path / "narrow"


SAID = ("--unit", "um/N", "--date-pattern", "%Y%m%d")


def test_what_many_files_lack_is_asked_for_once_and_answered_once(shop: Shop, narrow: Path) -> None:
    with pytest.raises(DataError) as refused:
        run("replay", shop.path, narrow)
    _, line = str(refused.value).splitlines()
    assert line.count("--date-pattern") == 1
    assert "20240101.csv, " in line
    assert re.search(r"20240103\.csv and 17 more: .*Real.*--unit", line)
    preview = CliRunner().invoke(app, ["replay", str(shop.path), str(narrow), "--dry-run"])
    assert preview.stdout.count("--unit") == 1
    few = CliRunner().invoke(app, ["replay", str(shop.path), *map(str, sorted(narrow.iterdir())[:4]), "--dry-run"])
    assert few.stdout.count("--unit") == 1
    assert "0 of 4" in few.stdout
    (narrow / "20240104.csv").write_text("Freq,Real,Imag\n1,2,3\n2,x,3\n3,4,5\n")
    with pytest.raises(DataError) as refused:
        run("replay", shop.path, narrow)
    assert len(str(refused.value).splitlines()) == 3


def test_files_of_other_lengths_lack_the_same(shop: Shop, tmp_path: Path) -> None:
    for number in range(5):
        (tmp_path / f"{number}.txt").write_text("".join(f"{f}\t1e-6\t-2e-7\n" for f in range(50 + number)))
    with pytest.raises(DataError) as refused:
        run("replay", shop.path, *sorted(tmp_path.glob("*.txt")))
    assert len(str(refused.value).splitlines()) == 2


def test_what_is_asked_of_many_tests_is_one_sentence_and_takes_one_answer(shop: Shop, narrow: Path) -> None:
    preview = run("replay", shop.path, narrow, *SAID, "--dry-run").stdout
    assert preview.count("(other-band)") == 1
    assert "2024-01-01 00:00 to 2024-01-20 00:00" in preview
    said = run("replay", shop.path, narrow, *SAID).stdout
    assert said.count("[mode] band_hz") == 1
    (remark,) = (remark for remark in shop.logbook.status().remarks if remark.code == "other-band")
    first, *_, last = [entry.id for entry in shop.folder.taps()]
    assert remark.about == f"20 tap tests, {first} to {last}"
    answer = f"lobewatch replay {shop.path} {shop.path / 'taps'} --accept other-band"
    assert answer in with_option_names(remark.cure)
    assert answer in said
    run(*answer.split()[1:])
    assert shop.logbook.questions == {}


def test_one_answer_is_for_those_that_ask_the_same(shop: Shop, narrow: Path) -> None:
    wider = frf(narrow.parent / "wider 20240201.csv", heading="Freq,Real,Imag")
    shop.edit("band_hz = [1000, 2400]", "band_hz = [1000, 9000]")
    run("replay", shop.path, *sorted(narrow.iterdir())[:2], wider, *SAID)
    one, other = (remark for remark in shop.logbook.status().remarks if remark.code == "other-band")
    assert one.about.startswith("2 tap tests, ")
    assert other.about.startswith("tap test ")
    (answer,) = re.findall(r"lobewatch (replay .* --accept other-band)", with_option_names(one.cure))
    run(*answer.split())
    (left,) = shop.logbook.questions
    assert left in other.about
