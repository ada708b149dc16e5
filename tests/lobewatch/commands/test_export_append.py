"""lobewatch export --append: Parquet by month that grows, read by DuckDB."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import threading
from contextlib import closing
from pathlib import Path
from typing import Any

import duckdb
import pytest

from acquisition import DataError
from tests.lobewatch.commands.invoke import invoke

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
KILLED = """
import os, sys, typer.testing
from lobewatch.cli import app
left = int(sys.argv.pop(1))
def counted(call):
    def run(*arguments, **settings):
        global left
        left -= 1
        if left < 0:
            os._exit(9)
        return call(*arguments, **settings)
    return run
for name in ("fsync", "replace", "rename", "mkdir", "unlink"):
    setattr(os, name, counted(getattr(os, name)))
sys.exit(typer.testing.CliRunner().invoke(app, sys.argv[1:], catch_exceptions=False).exit_code)
"""
"""An export that is ended without warning before it has altered the disk so many times."""


def export(*arguments: object) -> dict[str, Any]:
    result = invoke(["export", *map(str, arguments), "--json"])
    return {"exit_code": result.exit_code, **json.loads(result.stdout)}


def lines(folder: Path, columns: str = "month, folder, tap_id, frequency_hz") -> list[tuple[Any, ...]]:
    """Read the rows with DuckDB, in order."""
    with closing(duckdb.connect()) as base:
        place = f"read_parquet('{folder}/*/*.parquet', hive_partitioning = true, hive_types_autocast = false)"
        return base.sql(f"SELECT {columns} FROM {place} ORDER BY ALL").fetchall()


def files(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*.parquet")}


@pytest.fixture
def mills(shop: Shop, tmp_path: Path) -> Path:
    """Two machines tapped in January, February and March 2026, one of them in x only."""
    shop.put("")
    for days in (0.0, 30.0, 60.0):
        shop.tap(days, 1713.0 - days / 10)
    shutil.copytree(shop.path, tmp_path / "mills" / "a")
    for days in (0.1, 30.1):
        shop.tap(days, 1690.0, "y")
    shutil.move(shop.path, tmp_path / "mills" / "b")
    return tmp_path / "mills"


def tap_again(shop: Shop, mills: Path, days: float, frequency: float = 1700.0) -> str:
    """One more tap test of machine a."""
    shop.path = mills / "a"
    return str(shop.tap(days, frequency))


def test_lines_are_in_the_month_of_their_tap_test(mills: Path, tmp_path: Path) -> None:
    export(mills, tmp_path / "all.parquet")
    told = export(mills, "--append", tmp_path / "fleet")
    assert (told["exit_code"], told["machines"], told["tap_tests"], told["added"]) == (0, 2, 8, 8)
    assert {line[:2] for line in lines(tmp_path / "fleet")} == {
        (f"2026-0{month}", key) for month in (1, 2, 3) for key in "ab"
    }
    with closing(duckdb.connect()) as base:
        whole = base.sql(f"SELECT * FROM '{tmp_path}/all.parquet' ORDER BY ALL").fetchall()
    assert repr(lines(tmp_path / "fleet", "* EXCLUDE (month)")) == repr(whole)  # NaN is NaN
    assert {path.parent.name for path in (tmp_path / "fleet").rglob("*.parquet")} == {
        "month=2026-01",
        "month=2026-02",
        "month=2026-03",
    }


def test_what_is_new_is_added_and_no_file_is_altered(mills: Path, shop: Shop, tmp_path: Path) -> None:
    fleet = tmp_path / "fleet"
    export(mills, "--append", fleet)
    before = files(fleet)
    assert export(mills, "--append", fleet)["added"] == 0
    assert files(fleet) == before
    late, early = tap_again(shop, mills, 61), tap_again(shop, mills, 100)
    told = export(mills, "--append", fleet)
    assert (told["added"], told["tap_tests"], told["outdated_months"]) == (2, 10, [])
    after = files(fleet)
    assert {name: after[name] for name in before} == before
    assert sorted(name.split("/")[0] for name in after.keys() - before.keys()) == ["month=2026-03", "month=2026-04"]
    assert {late, early} <= {line[2] for line in lines(fleet)}
    assert len(lines(fleet)) == 10


def test_the_same_machines_give_the_same_files(mills: Path, tmp_path: Path) -> None:
    for name in ("one", "two"):
        export(mills, "--append", tmp_path / name)
    assert files(tmp_path / "one") == files(tmp_path / "two")


def test_ended_at_any_step_the_next_completes_it(mills: Path, tmp_path: Path) -> None:
    export(mills, "--append", tmp_path / "wanted")
    wanted, codes = lines(tmp_path / "wanted"), list[int]()
    while 0 not in codes:
        fleet = tmp_path / f"fleet-{len(codes)}"
        command = [sys.executable, "-c", KILLED, str(len(codes)), "export", str(mills), "--append", str(fleet)]
        codes.append(subprocess.run(command, check=False, capture_output=True).returncode)
        for temporary in fleet.glob("month=*/.*.tmp"):  # as far as the disk has got it
            temporary.write_bytes(temporary.read_bytes()[: len(codes)])
        assert export(mills, "--append", fleet)["exit_code"] == 0
        assert lines(fleet) == wanted
        assert not [*fleet.glob("month=*/.*.tmp")]
    assert set(codes[:-1]) == {9}
    assert len(codes) > 10


def test_of_exports_at_once_none_writes_twice(mills: Path, tmp_path: Path) -> None:
    fleet = tmp_path / "fleet"
    results = list[dict[str, Any]]()
    command = [sys.executable, "-m", "lobewatch.cli", "export", str(mills), "--append", str(fleet), "--json"]

    def run() -> None:
        done = subprocess.run(command, check=True, capture_output=True)
        results.append(json.loads(done.stdout))

    threads = [threading.Thread(target=run) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(told["added"] for told in results) == [0, 0, 0, 8]
    assert len({line[1:3] for line in lines(fleet)}) == len(lines(fleet)) == 8


def test_what_was_excluded_or_analysed_again_since_is_reported_by_its_month(mills: Path, tmp_path: Path) -> None:
    fleet = tmp_path / "fleet"
    export(mills, "--append", fleet)
    (tap,) = [line[2] for line in lines(fleet) if line[:2] == ("2026-02", "a")]
    invoke(["exclude", str(mills / "a"), tap, "--reason", "trial"])
    told = export(mills, "--append", fleet)
    assert (told["added"], told["tap_tests"], told["outdated_months"]) == (0, 7, ["2026-02"])
    shutil.rmtree(fleet / "month=2026-02")
    told = export(mills, "--append", fleet)
    assert (told["added"], told["outdated_months"]) == (2, [])
    assert ("a", tap) not in [line[1:3] for line in lines(fleet)]
    result = invoke(["export", str(mills), "--append", str(fleet)])
    first, second = result.stdout.splitlines()
    assert first.endswith(f"in {fleet}")
    assert second.startswith("0 ")


def test_a_machine_that_cannot_be_read_keeps_its_lines(mills: Path, tmp_path: Path) -> None:
    export(mills, "--append", tmp_path / "fleet")
    before = lines(tmp_path / "fleet")
    (mills / "a" / "machine.toml").write_text("x", "utf-8")
    told = export(mills, "--append", tmp_path / "fleet")
    assert (told["exit_code"], told["added"], told["outdated_months"], [*told["left_out"]]) == (2, 0, [], ["a"])
    assert lines(tmp_path / "fleet") == before


def test_a_folder_of_any_name_and_machines_without_a_tap_test(shop: Shop, tmp_path: Path) -> None:
    fleet = tmp_path / "o'brien [a] *"
    with pytest.raises(ValueError, match="Windows"):
        export(shop.path, "--append", fleet)
    fleet.mkdir()
    assert export(shop.path, "--append", fleet)["tap_tests"] == 0
    shop.tap(0, 1713.0)
    assert [export(shop.path, "--append", fleet)["added"] for _ in range(2)] == [1, 0]


def test_a_file_there_that_is_none_of_ours_is_named_and_nothing_is_written(mills: Path, tmp_path: Path) -> None:
    foreign = tmp_path / "fleet" / "month=2026-01" / "foreign.parquet"
    foreign.parent.mkdir(parents=True)
    foreign.write_bytes(b"no Parquet")
    with pytest.raises(DataError, match=r"--append .*foreign\.parquet"):
        export(mills, "--append", tmp_path / "fleet")
    assert [*(tmp_path / "fleet").rglob("*.parquet")] == [foreign]


@pytest.mark.parametrize(
    "arguments", [(), ("fleet.csv", "--append", "fleet"), ("--append", "fleet", "--to", "postgresql://db")]
)
def test_one_place_to_write_to_is_asked_for(mills: Path, arguments: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match="FILE, --append FOLDER and --to ADDRESS"):
        export(mills, *arguments)
