"""Hostile folders that could hang or crash a reader, next to a good one."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import sys
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn

import pytest

from lobewatch.cli import main
from lobewatch.screen import DashboardServer

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
SPARSE = 200_000_000_000
PATIENCE = 60
"""Time for one command on one machine (s): a hang is told from a busy computer."""


def tap_file(folder: Path) -> Path:
    return next((folder / "taps").glob("*.h5"))


def pipe(path: Path) -> None:
    path.parent.mkdir(exist_ok=True)
    path.unlink(missing_ok=True)
    os.mkfifo(path)


def sparse(path: Path) -> None:
    path.parent.mkdir(exist_ok=True)
    path.touch()
    os.truncate(path, SPARSE)


def text(path: Path, content: str) -> None:
    path.write_text(content, "utf-8")


def added(path: Path, content: str) -> None:
    text(path, path.read_text("utf-8") + content)


def folder_in_place(path: Path) -> None:
    path.unlink(missing_ok=True)
    path.mkdir()


def spooled(folder: Path) -> None:
    (folder / "spool").mkdir()
    pipe(folder / "spool" / "test" / "0001.h5")
    sparse(folder / "spool" / "test" / "setup.json")


def in_cuts(folder: Path) -> None:
    pipe(folder / "cuts" / "cut.h5")
    sparse(folder / "cuts" / "other.h5")


HOSTILE: dict[str, Callable[[Path], None]] = {
    "brackets": lambda m: text(m / "machine.toml", "a = " + "[" * 3000 + "]" * 3000),
    "dotted keys": lambda m: added(m / "machine.toml", "\n[notes]\n" + ".".join(["a"] * 20_000) + " = 1\n"),
    "huge machine.toml": lambda m: added(m / "machine.toml", "# more\n" * 100_000),
    "machine.toml a pipe": lambda m: pipe(m / "machine.toml"),
    "machine.toml a folder": lambda m: folder_in_place(m / "machine.toml"),
    "sparse standing": lambda m: sparse(m / "standing.json"),
    "standing a pipe": lambda m: pipe(m / "standing.json"),
    "history a pipe": lambda m: pipe(m / "history.rows"),
    "sparse history": lambda m: sparse(m / "history.rows"),
    "journal a pipe": lambda m: pipe(m / "journal.jsonl"),
    "sparse journal": lambda m: sparse(m / "journal.copy.jsonl"),
    "brackets in the journal": lambda m: added(m / "journal.jsonl", "[" * 100_000 + "\n"),
    "sparse tap file": lambda m: sparse(tap_file(m)),
    "tap file a pipe": lambda m: pipe(tap_file(m)),
    "unlisted pipe": lambda m: pipe(m / "taps" / "other.h5"),
    "unlisted sparse": lambda m: sparse(m / "taps" / "other.h5"),
    "daq.json a pipe": lambda m: pipe(m / "daq.json"),
    "unsent a pipe": lambda m: pipe(m / "unsent.json"),
    "told a pipe": lambda m: pipe(m / "told.json"),
    "holder of the lock a pipe": lambda m: pipe(m / ".lock.holder"),
    "lock a folder": lambda m: folder_in_place(m / ".lock"),
    "spool": spooled,
    "cuts": in_cuts,
}


@contextmanager
def in_time() -> Iterator[None]:
    """TimeoutError for calls that never return, for instance opening a pipe without a writer."""

    def give_up(_signal: int, _frame: FrameType | None) -> NoReturn:
        raise TimeoutError("it hangs")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(PATIENCE)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.fixture
def plant(shop: Shop, tmp_path: Path) -> Path:
    """Put only the good machine into a fleet folder."""
    shop.run(("A", 12900, 1.5))
    shop.tap_both()
    shop.tap_both(30.0, 0.999)
    return Path(shutil.copytree(shop.path, tmp_path / "mills" / "good")).parent


@pytest.fixture
def twin(shop: Shop, tmp_path: Path) -> Path:
    """Make another machine with tap tests of its own, as copies of the good one would be named."""
    other = type(shop)(tmp_path / "twin")
    other.run(("A", 12900, 1.5))
    other.tap_both(1.0)
    other.tap_both(30.0, 0.999)
    return Path(other.path)


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[int, str, str]]:
    """Run a command that must neither hang nor fail unexpectedly."""

    def command(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["lobewatch", *map(str, arguments)])
        with in_time(), pytest.raises(SystemExit) as end:
            main()
        out, err = capsys.readouterr()
        assert not re.search(r"\b[A-Z]\w+(?:Error|Exception)\b", out + err)  # an unexpected one has its type
        return int(end.value.code or 0), out, err

    return command


def line_of_good(out: str) -> Any:
    (line,) = (machine for machine in json.loads(out)["machines"] if machine["key"] == "good")
    return {name: value for name, value in line.items() if name != "days_left"}


def served(plant: Path) -> Any:
    with DashboardServer(plant) as server, in_time():
        asked = urllib.request.Request(f"{server.origin}/machines", headers={"Authorization": f"Bearer {server.token}"})
        with urllib.request.urlopen(asked) as answer:
            return line_of_good(answer.read().decode())


def test_hostile_folders_cost_a_good_one_nothing(
    plant: Path, twin: Path, said: Callable[..., tuple[int, str, str]], tmp_path: Path
) -> None:
    code, alone, _ = said("status", plant, "--json")
    assert code == 0
    said("export", plant, tmp_path / "alone.csv")
    on_page = served(plant)
    said("status", twin)
    for name, make in HOSTILE.items():
        make(Path(shutil.copytree(twin, plant / name)))
    code, among, _ = said("status", plant, "--json", "--prometheus", tmp_path / "all.prom")
    lights = {machine["key"]: machine["light"] for machine in json.loads(among)["machines"]}
    assert code == 1
    assert line_of_good(among) == line_of_good(alone)
    assert lights.keys() == {"good", *HOSTILE}
    unreadable = {"brackets", "dotted keys", "huge machine.toml", "machine.toml a pipe", "machine.toml a folder"}
    assert unreadable | {"journal a pipe", "sparse journal"} <= {n for n, light in lights.items() if light == "unknown"}
    assert 'folder="good"' in (tmp_path / "all.prom").read_text()
    code, _, err = said("export", plant, tmp_path / "all.csv")
    assert code == 2
    assert "brackets" in err
    lines = (tmp_path / "all.csv").read_text().splitlines()
    of_good = [line for line in (tmp_path / "alone.csv").read_text().splitlines() if line.startswith("good,")]
    assert [line for line in lines if line.startswith("good,")] == of_good != []
    assert served(plant) == on_page
    code, _, _ = said("report", plant, "--out", tmp_path / "fleet.html")
    assert code == 0
    assert "dotted keys" in (tmp_path / "fleet.html").read_text()
    code, _, err = said("rebuild", plant)
    assert code == 2
    assert "brackets" in err
    assert line_of_good(said("status", plant, "--json")[1]) == line_of_good(alone)


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_folder_alone_is_evaluated_or_rejected(
    plant: Path, said: Callable[..., tuple[int, str, str]], name: str
) -> None:
    folder = plant / "good"
    HOSTILE[name](folder)
    for command in ("verify", "history", "rebuild", "check"):
        code, _, err = said(command, folder)
        assert code in (0, 1, 2), command
        assert (code == 2) == err.startswith("error: "), (command, err)
