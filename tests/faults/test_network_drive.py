"""A folder on a network drive without locks, links or syncs of folders, whose files change their numbers and go stale.

Reading goes on, writing works or is refused in one sentence with what to do, and nothing is lost.
"""

from __future__ import annotations

import errno
import fcntl
import os
import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from acquisition.errors import format_error
from lobewatch import Logbook
from lobewatch.cli import app
from tests.lobewatch.conftest import Shop

READING = (
    ["status", "PLANT"],
    ["history", "MACHINE"],
    ["trend", "MACHINE"],
    ["verify", "MACHINE"],
    ["check", "MACHINE"],
)
WRITING = (["event", "MACHINE", "bearings"], ["exclude", "MACHINE", "TAP", "--reason", "x"], ["rebuild", "MACHINE"])


@pytest.fixture
def tapped(tmp_path: Path) -> Shop:
    """Return a machine with one program and two tap tests, in a fleet."""
    shop = Shop(tmp_path / "m")
    shop.run(("A", 12900, 1.5))
    shop.tap_both()
    return shop


def run(shop: Shop, command: list[str]) -> tuple[int, str]:
    """Return the exit code and the output; an unexpected error fails the test."""
    tap = next((shop.path / "taps").iterdir())
    words = {"PLANT": str(shop.path.parent), "MACHINE": str(shop.path), "TAP": tap.stem}
    done = CliRunner().invoke(app, [words.get(word, word) for word in command])
    if done.exception is None or isinstance(done.exception, SystemExit):
        return done.exit_code, done.output
    assert isinstance(done.exception, OSError | ValueError), done.exception
    return 2, format_error(done.exception)


def rows(shop: Shop) -> list[str]:
    """Without rulings, which are worked out as they are asked for."""
    return [repr(replace(row, verdicts=None)) for row in Logbook.open(shop.path).history.rows]


def failing(number: int, real: Callable[..., Any], when: Callable[..., bool]) -> Callable[..., Any]:
    def call(*arguments: Any, **options: Any) -> Any:
        if when(*arguments):
            path = [str(word) for word in arguments[:1] if isinstance(word, str | Path)]
            raise OSError(number, os.strerror(number), *path)
        return real(*arguments, **options)

    return call


@pytest.mark.parametrize("number", [errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EIO, errno.ESTALE])
@pytest.mark.parametrize("left_over", [False, True], ids=["new", "locked before"])
def test_without_locks_reading_goes_on_and_writing_is_rejected(
    tapped: Shop, monkeypatch: pytest.MonkeyPatch, number: int, left_over: bool
) -> None:
    if left_over:
        with tapped.folder.locked():
            pass
    expected, journal = rows(tapped), tapped.folder.journal.path.read_bytes()
    monkeypatch.setattr(fcntl, "flock", failing(number, fcntl.flock, lambda *_: True))
    for command in READING:
        code, said = run(tapped, command)
        assert code in (0, 1), said
    for command in WRITING:
        code, said = run(tapped, command)
        assert code == 2, said
        assert os.strerror(number) in said
        assert "lock" in said
    assert tapped.folder.journal.path.read_bytes() == journal
    monkeypatch.undo()
    assert rows(tapped) == expected
    assert run(tapped, ["event", "MACHINE", "bearings"])[0] == 0


@pytest.mark.parametrize("number", [errno.EINVAL, errno.EOPNOTSUPP, errno.ENOSYS])
def test_folders_that_cannot_be_synced_are_written_all_the_same(
    tapped: Shop, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    monkeypatch.setattr(os, "fsync", failing(number, os.fsync, lambda handle: Path(f"/proc/self/fd/{handle}").is_dir()))
    tapped.tap(30, 1700.0)
    for command in (*READING, *WRITING):
        code, said = run(tapped, command)
        assert code in (0, 1), said
    assert len(tapped.folder.contents().taps) == 3


@pytest.mark.parametrize("number", [errno.EINVAL, errno.ESTALE, errno.EXDEV, errno.EPERM])
def test_where_nothing_can_be_renamed_nothing_is_lost(
    tapped: Shop, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    expected = rows(tapped)
    for name in ("rename", "replace", "link"):
        monkeypatch.setattr(os, name, failing(number, getattr(os, name), lambda *_: True))
    for command in READING:
        code, said = run(tapped, command)
        assert code in (0, 1), said
    with pytest.raises(OSError, match=os.strerror(number)) as refusal:
        tapped.tap(30, 1700.0)
    assert str(tapped.path / "taps") in format_error(refusal.value)
    monkeypatch.undo()
    assert run(tapped, ["verify", "MACHINE"])[0] == 0
    assert rows(tapped) == expected
    assert not [*tapped.path.rglob("*.tmp")]


def test_numbers_of_files_that_change_at_every_look_change_no_result(
    tapped: Shop, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected, said_before = rows(tapped), [run(tapped, command) for command in READING]
    real, chance = os.stat, random.Random(1)

    def stat(*arguments: Any, **options: Any) -> os.stat_result:
        status = real(*arguments, **options)
        mode, _, *others = status
        return os.stat_result((mode, chance.getrandbits(40), *others), {"st_mtime_ns": status.st_mtime_ns})

    monkeypatch.setattr(os, "stat", stat)
    assert [run(tapped, command) for command in READING] == said_before
    assert rows(tapped) == expected


@pytest.mark.parametrize("every", [7, pytest.param(1, marks=pytest.mark.long)])
def test_a_file_that_is_stale_when_it_is_opened_is_named_or_does_not_matter(
    tapped: Shop, monkeypatch: pytest.MonkeyPatch, every: int
) -> None:
    expected, tried = rows(tapped), 0
    for command in (*READING, *WRITING[:1]):
        stale = 0
        while True:
            count = iter(range(10_000))

            def is_due(path: Any, *_: Any, at: int = stale, count: Any = count) -> bool:
                return str(path).startswith(str(tapped.path)) and next(count) == at

            with monkeypatch.context() as patch:
                patch.setattr(os, "open", failing(errno.ESTALE, os.open, is_due))
                run(tapped, command)
            if next(count) <= stale:
                break
            stale, tried = stale + every, tried + 1
    assert tried >= 8
    assert rows(tapped) == expected
    assert run(tapped, ["verify", "MACHINE"])[0] == 0
