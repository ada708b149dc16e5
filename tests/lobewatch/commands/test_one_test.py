"""`--one-test` and `--axes`: several files, groups, numbered channels and arrays as one tap test, by the commands."""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from recorded_hits import RATE, make_hits, put_hit
from typer.testing import Result

from acquisition import DataError, read_hits, read_tap
from lobewatch import Logbook
from lobewatch.show import replays
from tests.lobewatch.commands.invoke import invoke

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
HITS = make_hits(5)
DATED = ("--date", "2026-05-01", "--direction", "x")
NAMED = ("--columns", "force [N],acceleration [m/s^2]", "--rate", str(RATE))


@pytest.fixture
def shop(shop: Shop) -> Shop:
    """Without programs, which take their time."""
    shop.put("")
    return shop


@pytest.fixture
def files(tmp_path: Path) -> list[Path]:
    folder = tmp_path / "hits"
    folder.mkdir()
    return [put_hit(folder / f"hit{k}.csv", hit) for k, hit in enumerate(HITS, 1)]


@pytest.fixture
def array(tmp_path: Path) -> Path:
    np.save(tmp_path / "hits.npy", HITS)
    return tmp_path / "hits.npy"


def run(*arguments: object) -> Result:
    return invoke([*map(str, arguments)])


def answer(*arguments: object) -> Any:
    return json.loads(run(*arguments, "--json").stdout)


def frequencies(modes: Any) -> list[float]:
    return [mode["frequency_hz"] for mode in modes]


def test_files_become_one_tap_test_that_keeps_them_all(shop: Shop, files: list[Path]) -> None:
    said = answer("replay", shop.path, *files, "--one-test", *DATED)
    (tap,) = shop.folder.taps()
    assert said["hits"] == {tap.id: {"found": 5, "used": 5}}
    assert said["remarks"] == []
    stored = read_tap(shop.path / tap.file)
    assert stored.required_frf.n_averages == 5
    assert stored.source is not None
    with zipfile.ZipFile(io.BytesIO(stored.source.content)) as archive:
        assert [archive.read(name) for name in archive.namelist()] == [file.read_bytes() for file in files]
    again = answer("replay", shop.path, *files, "--one-test", *DATED)
    assert list(again["known"].values()) == [tap.id]
    assert len(shop.folder.taps()) == 1
    run("replay", shop.path, *files[:3], "--one-test", *DATED)
    assert len(shop.folder.taps()) == 2


def test_without_the_option_each_file_is_a_tap_test_and_the_option_is_named(shop: Shop, files: list[Path]) -> None:
    said = answer("replay", shop.path, *files, *DATED)
    assert len(shop.folder.taps()) == 5
    assert [remark["code"] for remark in said["remarks"]] == ["one-hit-tests"]
    assert "--one-test" in said["remarks"][0]["cure"]


def test_a_folder_an_array_and_files_give_the_same_modes(files: list[Path], array: Path) -> None:
    by_files = answer("modes", *files, "--one-test")
    by_folder = answer("modes", files[0].parent, "--one-test")
    by_array = answer("modes", array, "--axes", "hits,channels,samples", *NAMED)
    for found in (by_files, by_folder, by_array):
        assert (found["n_averages"], found["n_hits_found"]) == (5, 5)
        assert frequencies(found["modes"]) == pytest.approx(frequencies(by_files["modes"]), rel=1e-6)
    assert frequencies(by_files["modes"])[0] == pytest.approx(400, rel=1e-3)


def test_the_first_command_names_what_the_second_needs(shop: Shop, array: Path) -> None:
    with pytest.raises(DataError, match=r"--axes, for example hits,channels,samples.*--columns.*--rate"):
        run("replay", shop.path, array, *DATED)
    assert not shop.folder.taps()
    said = answer("replay", shop.path, array, *DATED, *NAMED, "--axes", "hits,channels,samples")
    assert list(said["hits"].values()) == [{"found": 5, "used": 5}]


@pytest.mark.parametrize("axes", ["hits,samples", "hits;channels;samples", "x"])
def test_other_axes_are_an_error_of_the_option(shop: Shop, array: Path, axes: str) -> None:
    with pytest.raises(DataError, match="--axes"):
        run("replay", shop.path, array, *DATED, *NAMED, "--axes", axes)
    assert not shop.folder.taps()


@pytest.mark.parametrize("command", ["replay", "modes"])
def test_bad_files_and_bad_hits_are_named_and_counted(shop: Shop, files: list[Path], command: str) -> None:
    put_hit(files[1], HITS[1], rate=2 * RATE)
    put_hit(files[2], HITS[2, :1], "time [s],force [N]")
    double = HITS[3] + 0.9 * np.roll(HITS[3], 80, axis=1) * np.array([[1.0], [0.0]])
    put_hit(files[3], double)
    if command == "replay":
        said = answer("replay", shop.path, *files, "--one-test", *DATED)
        (count,) = said["hits"].values()
        assert (count["found"], read_tap(shop.path / shop.folder.taps()[0].file).required_frf.n_averages) == (
            5,
            count["used"],
        )
        text = run("replay", shop.path, *files[:4], "--one-test", *DATED).stdout
    else:
        said = answer("modes", *files, "--one-test")
        count = {"found": said["n_hits_found"], "used": said["n_averages"]}
        text = run("modes", *files, "--one-test").stdout
    assert count == {"found": 5, "used": 2}
    left_out = [remark["about"] for remark in said["remarks"] if remark["code"] == "hit-left-out"]
    assert sorted(left_out) == ["hit2.csv, hit 1", "hit3.csv"]
    assert all(place in text for place in left_out)


def test_a_dry_run_counts_hits_and_stores_nothing(shop: Shop, files: list[Path]) -> None:
    put_hit(files[1], HITS[1], rate=2 * RATE)
    said = answer("replay", shop.path, *files, "--one-test", *DATED, "--dry-run")
    (one,) = said["files"]
    assert (one["hits"], one["averages"]) == (["good"] * 4, 4)
    assert [remark["about"] for remark in one["remarks"]] == ["hit2.csv, hit 1"]
    assert not shop.folder.taps()


def test_workers_store_the_same_tap_test(shop: Shop, files: list[Path]) -> None:
    run("replay", shop.path, *files, "--one-test", *DATED, "--jobs", "2")
    assert read_tap(shop.path / shop.folder.taps()[0].file).required_frf.n_averages == 5


def test_no_file_can_be_used_or_one_is_missing(shop: Shop, files: list[Path]) -> None:
    for file, hit in zip(files, HITS, strict=True):
        put_hit(file, hit[:1], "time [s],force [N]")
    with pytest.raises(DataError, match=r"hit1\.csv"):
        run("replay", shop.path, *files, "--one-test", *DATED)
    with pytest.raises(OSError, match="none"):
        run("replay", shop.path, *files, files[0].with_name("none.csv"), "--one-test", *DATED)
    assert not shop.folder.taps()


def test_converted_hits_are_those_of_all_files(files: list[Path], tmp_path: Path) -> None:
    out = tmp_path / "all.uff"
    said = answer("convert", *files, out, "--hits", "--one-test")
    assert said["remarks"] == []
    hits = read_hits(out)
    assert np.array([hit.signals for hit in hits]) == pytest.approx(HITS, rel=1e-9, abs=1e-9)
    for command in (("convert", *files[:2], out), ("modes", *files)):
        with pytest.raises(ValueError, match=r"[25] files.*--one-test"):
            run(*command)


def test_a_changed_file_becomes_another_tap_test(shop: Shop, files: list[Path]) -> None:
    run("replay", shop.path, *files, "--one-test", *DATED)
    put_hit(files[4], make_hits(6)[5])
    run("replay", shop.path, *files, "--one-test", *DATED)
    assert len({tap.source_sha256 for tap in shop.folder.taps()}) == 2
    assert len(Logbook.open(shop.path).taps) == 2


def test_groups_of_an_hdf5_file_are_one_tap_test(shop: Shop, tmp_path: Path) -> None:
    path = tmp_path / "groups.h5"
    with h5py.File(path, "w") as file:
        for k, hit in enumerate(HITS, 1):
            file[f"tap_{k:02d}/force"], file[f"tap_{k:02d}/acc"] = hit
    with pytest.raises(DataError, match=r"--one-test.*--columns.*--rate"):
        run("replay", shop.path, path, *DATED)
    columns = ("--columns", "force [N]=force,acceleration [m/s^2]=acc", "--rate", RATE)
    said = answer("replay", shop.path, path, *DATED, "--one-test", *columns)
    assert list(said["hits"].values()) == [{"found": 5, "used": 5}]


def test_files_in_another_order_are_the_stored_tap_test(shop: Shop, files: list[Path]) -> None:
    in_order = (files[2], files[0], files[4], files[1], files[3])
    run("replay", shop.path, *in_order, "--one-test", *DATED, "--reject-hit", 1)
    (tap,) = shop.folder.taps()
    stored = np.array([hit.signals for hit in read_tap(shop.path / tap.file).hits])
    assert stored == pytest.approx(HITS[[2, 0, 4, 1, 3]], abs=1e-6)
    for again in (files, files[::-1], [*files, files[0]]):
        assert list(answer("replay", shop.path, *again, "--one-test", *DATED)["known"].values()) == [tap.id]
    run("replay", shop.path, *files, "--one-test", *DATED, "--reject-hit", 1)
    for options in ((), ("--dry-run",)):
        with pytest.raises(ValueError, match=tap.id):
            run("replay", shop.path, *files, "--one-test", *DATED, "--reject-hit", 3, *options)
    assert [(entry.id, len(entry.hit_decisions)) for entry in shop.folder.taps()] == [(tap.id, 1)]


@pytest.mark.parametrize("command", ["replay", "modes"])
def test_an_empty_first_file_and_a_repeated_file_are_named(shop: Shop, files: list[Path], command: str) -> None:
    files[0].write_text("")
    given = ("replay", shop.path, *DATED) if command == "replay" else ("modes",)
    said = answer(*given, *files, files[1], "--one-test")
    left_out = [remark["about"] for remark in said["remarks"] if remark["code"] == "hit-left-out"]
    assert left_out == [files[0].name, f"{files[1]}, hit 1"]


def test_ten_files_of_a_folder_are_averaged_in_the_order_of_their_numbers(shop: Shop, tmp_path: Path) -> None:
    hits = make_hits(10)
    (tmp_path / "ten").mkdir()
    for number, hit in enumerate(hits, 1):
        put_hit(tmp_path / "ten" / f"hit_{number}.csv", hit)
    run("replay", shop.path, tmp_path / "ten", "--one-test", *DATED)
    stored = read_tap(shop.path / shop.folder.taps()[0].file)
    assert np.array([hit.signals for hit in stored.hits]) == pytest.approx(hits, abs=1e-6)


def test_a_single_file_needs_no_line_of_progress(
    shop: Shop, files: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(replays, "FIRST_LINE_DELAY", 0.0)
    monkeypatch.setattr(replays, "LINE_INTERVAL", 0.0)
    step = replays.REPLAY_STEP_NAMES["store"]
    assert step not in run("replay", shop.path, *files[:2], "--one-test", *DATED).stderr
    assert step in run("replay", shop.path, *files[2:], *DATED).stderr
