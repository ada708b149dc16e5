"""Lock of a machine folder: waiting, and the name of its holder."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from acquisition import DataError
from lobewatch.machine import BusyError, MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.machine.folder_lock import LOCK_HOLDER_NAME, LOCK_NAME, MIN_LEFTOVER_AGE

HOLD = """
import sys, time
from lobewatch.machine import MachineFolder
sys.argv = ["/usr/bin/lobewatch", "--debug", "sensors", "mill"]
with MachineFolder(PATH).locked():
    print(flush=True)
    sys.stdin.readline()
    time.sleep(0.3)
"""
"""Holds the lock until it is told to go on, and a moment longer."""


@pytest.fixture
def folder(tmp_path: Path) -> MachineFolder:
    make_machine_folder(tmp_path / "m", "new_machine.toml")
    return MachineFolder(tmp_path / "m")


@contextmanager
def holding(folder: MachineFolder) -> Iterator[subprocess.Popen[str]]:
    """Another program that holds the lock already."""
    program = HOLD.replace("PATH", repr(str(folder.path)))
    line = [sys.executable, "-c", program]
    with subprocess.Popen(line, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "\n"
        try:
            yield process
        finally:
            process.kill()


def test_the_holder_is_named(folder: MachineFolder) -> None:
    with holding(folder) as process:
        holder = rf"`lobewatch sensors` \(process {process.pid}, since \d\d:\d\d\)"
        with pytest.raises(BusyError, match=f"m: {holder} "):
            folder.locked(patience=0.05).__enter__()


def test_it_is_waited_for(folder: MachineFolder) -> None:
    with holding(folder) as process:
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
        with folder.locked():
            assert (folder.path / LOCK_HOLDER_NAME).exists()
    assert not (folder.path / LOCK_HOLDER_NAME).exists()


def test_a_name_that_a_killed_program_has_left_is_not_believed(folder: MachineFolder) -> None:
    with holding(folder) as process:
        process.kill()
        process.wait()
        assert (folder.path / LOCK_HOLDER_NAME).exists()
        with folder.locked(patience=0), pytest.raises(BusyError, match=rf"process {os.getpid()}, since"):
            MachineFolder(folder.path).locked(patience=0).__enter__()


@pytest.mark.parametrize("content", [None, b"", b'{"command":"lobew', b'{"command":1}', b"\xff"])
def test_one_that_has_not_reported_its_name_holds_it_all_the_same(folder: MachineFolder, content: bytes | None) -> None:
    with holding(folder):
        (folder.path / LOCK_HOLDER_NAME).unlink()
        if content is not None:
            (folder.path / LOCK_HOLDER_NAME).write_bytes(content)
        with pytest.raises(BusyError, match="m: another lobewatch "):
            folder.locked(patience=0).__enter__()


def test_a_folder_that_is_away_is_not_made_again(folder: MachineFolder) -> None:
    away = folder.path.rename(folder.path.with_name("away"))
    with pytest.raises(FileNotFoundError, match=r"m'$"):
        folder.locked().__enter__()
    assert not folder.path.exists()
    away.rename(folder.path)
    with folder.locked():
        assert (folder.path / LOCK_HOLDER_NAME).exists()


def test_a_folder_that_goes_away_at_any_moment_is_not_made_again(folder: MachineFolder) -> None:
    over, away = threading.Event(), folder.path.with_name("away")

    def lock() -> None:
        while not over.is_set():
            with suppress(OSError, DataError), MachineFolder(away.with_name("m")).locked():
                pass

    (thread := threading.Thread(target=lock)).start()
    try:
        for _ in range(200):
            folder.path.rename(away)
            time.sleep(0.001)
            assert not folder.path.exists()
            away.rename(folder.path)
            time.sleep(0.001)
    finally:
        over.set()
        thread.join()


def test_held_twice_it_is_held_until_the_outer_end(folder: MachineFolder) -> None:
    with folder.locked():
        with folder.locked():
            pass
        assert (folder.path / LOCK_HOLDER_NAME).exists()
        with pytest.raises(BusyError):
            MachineFolder(folder.path).locked(patience=0).__enter__()
    with MachineFolder(folder.path).locked(patience=0):
        pass


def test_half_written_files_of_killed_programs_are_removed_by_the_next_owner(folder: MachineFolder) -> None:
    names = ["..lock.holder.0123abcd.tmp", ".machine.toml.0123abcd.tmp", ".report.html.89abcdef.tmp", ".mine.tmp"]
    for name in names:
        (folder.path / name).write_bytes(b"half")
        os.utime(folder.path / name, (time.time() - MIN_LEFTOVER_AGE - 1,) * 2)
    os.utime(folder.path / names[2])  # a program without the lock is still writing this one
    with folder.locked():
        assert {path.name for path in folder.path.glob(".*.tmp")} == {names[2], names[3]}


def test_a_lock_that_windows_refuses_for_a_moment_is_tried_again(
    folder: MachineFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    refusals, real = [5, 32, 33], os.open

    def refuse(path: Path, *arguments: int) -> int:
        if str(path).endswith(LOCK_NAME) and refusals:
            error = PermissionError(13, "Access is denied", path)
            error.winerror = refusals.pop()  # type: ignore[attr-defined]
            raise error
        return real(path, *arguments)

    monkeypatch.setattr(os, "open", refuse)
    monkeypatch.setattr("acquisition.file_io.time.sleep", lambda _: None)
    with folder.locked(patience=0):
        assert not refusals


def test_ctrl_c_ends_the_waiting(folder: MachineFolder) -> None:
    """The folder can be locked again afterwards."""

    def pressed(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, pressed)
    try:
        with holding(folder):
            signal.setitimer(signal.ITIMER_REAL, 0.2)
            with pytest.raises(KeyboardInterrupt):
                folder.locked(patience=100).__enter__()
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    with folder.locked():
        pass
