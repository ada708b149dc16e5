"""Files that another program has open for a moment, names that Windows cannot store, and modes of files."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition import atomic_write, file_io
from acquisition.file_io import RETRY_TIME, check_file_name, delete, delete_folder, rename


class FakeTime:
    """A clock that only sleeping moves."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds
        assert self.now < 200, "no end of trying"


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> FakeTime:
    fake = FakeTime()
    monkeypatch.setattr(file_io, "time", fake)
    return fake


def refused_until(clock: FakeTime, end: float, winerror: int | None, real: Callable[..., Any]) -> Callable[..., Any]:
    """Make an operation of the system that Windows refuses up to a time."""

    def operation(*arguments: Any, **options: Any) -> Any:
        if clock.now < end:
            error = PermissionError(13, "Access is denied", str(arguments[0]))
            error.winerror = winerror  # type: ignore[attr-defined]
            raise error
        return real(*arguments, **options)

    return operation


OPERATIONS = [
    ("replace", lambda path: rename(path, path.with_name("new"))),
    ("unlink", delete),
    ("replace", lambda path: atomic_write(path, b"new")),
    ("rmdir", lambda path: delete_folder(path.parent)),
]


@pytest.mark.parametrize("winerror", [5, 32, 33])
@pytest.mark.parametrize(("name", "operation"), OPERATIONS)
def test_what_another_program_uses_for_a_moment_is_tried_again(
    name: str,
    operation: Callable[[Path], Any],
    winerror: int,
    tmp_path: Path,
    clock: FakeTime,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    path = tmp_path / "folder" / "file"
    path.parent.mkdir()
    path.write_bytes(b"old")
    monkeypatch.setattr(os, name, refused_until(clock, 100 + 0.9 * RETRY_TIME, winerror, getattr(os, name)))
    operation(path)
    assert 0.9 * RETRY_TIME <= clock.now - 100 <= RETRY_TIME
    assert not path.exists() or path.read_bytes() == b"new"


@pytest.mark.parametrize(("winerror", "waited"), [(32, RETRY_TIME), (2, 0.0), (None, 0.0)])
def test_what_stays_in_use_is_an_error_after_two_seconds_and_other_errors_at_once(
    winerror: int | None, waited: float, tmp_path: Path, clock: FakeTime, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"old")
    monkeypatch.setattr(os, "replace", refused_until(clock, 1e9, winerror, os.replace))
    with pytest.raises(OSError, match="Access is denied"):
        atomic_write(path, b"new")
    assert clock.now - 100 == pytest.approx(waited, abs=file_io.RETRY_INTERVAL)
    assert [*tmp_path.iterdir()] == [path]
    assert path.read_bytes() == b"old"


def test_a_folder_that_cannot_be_deleted_at_all_loses_what_can_be_deleted(
    tmp_path: Path, clock: FakeTime, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("a", "b"):
        (tmp_path / "folder" / name).mkdir(parents=True)
    monkeypatch.setattr(shutil, "rmtree", refused_until(clock, 101, 5, shutil.rmtree))
    delete_folder(tmp_path / "folder")
    assert not (tmp_path / "folder").exists()
    delete_folder(tmp_path / "folder")


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o664])
def test_a_file_keeps_its_mode(mode: int, tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_bytes(b"old")
    path.chmod(mode)
    atomic_write(path, b"new")
    assert (path.read_bytes(), path.stat().st_mode & 0o777) == (b"new", mode)


RESERVED = ["CON", "nul", "Aux", "prn.txt", "COM1", "com9.csv", "LPT³.h5", "con .x", "CONIN$"]


@pytest.mark.parametrize("name", [*RESERVED, "a.", "a ", "a:b", "a?", 'a"b', "a|b", "<b>", "a*", "a\\b", "a\tb", "..."])
def test_a_name_that_windows_cannot_store_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="Windows"):
        check_file_name(tmp_path / name)
    with pytest.raises(ValueError, match="Windows"):
        atomic_write(tmp_path / name, b"")
    with pytest.raises(ValueError, match="Windows"):
        file_io.make_folder(tmp_path / "new" / name / "inside")
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize(
    "name", ["console", "com", "com10", "null.csv", "a.con", "Fräse 3", ".hidden", "-con", "a b.c"]
)
def test_a_name_that_only_looks_like_one_is_not(name: str, tmp_path: Path) -> None:
    atomic_write(tmp_path / name, b"content")
    assert (tmp_path / name).read_bytes() == b"content"


@given(st.text(st.characters(exclude_categories=["Cc", "Cs"], exclude_characters='<>:"|?*/\\'), max_size=20))
def test_any_other_name_between_harmless_letters_is_possible(name: str) -> None:
    check_file_name(Path(f"m{name}n"))


def test_existing_folders_and_relative_paths_stay_usable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    inside = tmp_path / "a:b" / "inside"
    inside.parent.mkdir()
    file_io.make_folder(inside)
    monkeypatch.chdir(inside)
    for path in (Path(), Path(".."), Path("../.."), Path("/")):
        check_file_name(path)
    atomic_write(Path("x"), b"")
    assert inside.joinpath("x").exists()
