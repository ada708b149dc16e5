"""The machine folder: what was committed is there, and damage is named."""

from __future__ import annotations

import json
import os
import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from acquisition import Circumstances, DataError, Frf, SourceFile, TapTest, new_tap_id
from lobewatch.machine import BusyError
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder

pytestmark = pytest.mark.quick

START = datetime(2026, 1, 15, 9, tzinfo=UTC)


def tap(days: float = 0.0, source: SourceFile | None = None, **about: str) -> TapTest:
    circumstances = replace(Circumstances("m", START + timedelta(days=days), "reference"), **about)  # type: ignore[arg-type]
    frf = Frf(np.arange(1.0, 50.0), np.linspace(1 + 1j, 49 + 49j, 49).astype(np.complex128))
    return TapTest(new_tap_id(circumstances), circumstances, frf, source=source)


@pytest.fixture
def folder(tmp_path: Path) -> MachineFolder:
    make_machine_folder(tmp_path / "m", "new_machine.toml")
    return MachineFolder(tmp_path / "m")


def test_commits_are_listed_by_the_time_of_the_tap_and_read_back(folder: MachineFolder) -> None:
    late, early = tap(30), tap(0, SourceFile("a.csv", b"abc"), direction="y")
    folder.commit(late)
    folder.commit(early)
    entries = folder.taps()
    assert [entry.id for entry in entries] == [early.id, late.id]
    assert [entry.direction for entry in entries] == ["y", "x"]
    assert entries[0].source_sha256.startswith("ba7816bf")
    assert folder.read(entries[0]).source == early.source


def test_every_line_of_the_journal_names_the_one_before(folder: MachineFolder) -> None:
    for day in range(3):
        folder.commit(tap(day))
    lines = [json.loads(line) for line in (folder.path / "journal.jsonl").read_text().splitlines()]
    assert lines[0]["previous"] == ""
    assert len({line["previous"] for line in lines}) == 3
    assert all(line["kind"] == "tap" for line in lines)


def test_a_line_cut_short_by_a_full_disk_is_no_commit(folder: MachineFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    spooled = folder.spool / tap(0).id
    committed = replace(tap(0), id=spooled.name)
    spooled.mkdir(parents=True)
    write = os.write
    monkeypatch.setattr("os.write", lambda handle, line: write(handle, line[: len(line) // 2]))
    with pytest.raises(OSError, match=r"journal\.jsonl"):
        folder.commit(committed)
    monkeypatch.undo()
    assert spooled.is_dir()
    assert folder.taps() == []
    folder.commit(committed)
    assert len(folder.taps()) == 1
    assert not spooled.exists()


def test_an_altered_or_missing_file_is_named(folder: MachineFolder) -> None:
    folder.commit(tap())
    (entry,) = folder.taps()
    path = folder.path / "taps" / f"{entry.id}.h5"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(DataError, match=rf"{entry.id}\.h5: .*SHA-256"):
        folder.read(entry)
    path.unlink()
    with pytest.raises(DataError, match=rf"{entry.id}\.h5: missing"):
        folder.read(entry)


def test_two_writers_are_distinguished(folder: MachineFolder) -> None:
    refusal = pytest.raises(BusyError, match=rf"m: .*process {os.getpid()}")
    with folder.locked(), refusal, MachineFolder(folder.path).locked(patience=0):
        pass
    with folder.locked():
        pass


def test_a_folder_without_machine_toml_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=rf"machine\.toml.*make_machine_folder {re.escape(str(tmp_path))}"):
        MachineFolder(tmp_path)


def test_a_machine_folder_is_not_overwritten(folder: MachineFolder) -> None:
    with pytest.raises(DataError, match=r"m.machine\.toml: "):
        make_machine_folder(folder.path, "new_machine.toml")
    assert folder.machine.machine.name == "m"
