"""Journals and settings of earlier versions open without a fault, and are added to."""

from __future__ import annotations

import json
import shutil
from collections import Counter
from pathlib import Path

import pytest

from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_updates import add_event, include_entry
from lobewatch.machine.verify_files import verify

OLDER = Path(__file__).parents[2] / "data" / "older_folders"
VERSIONS = sorted(path.name for path in OLDER.iterdir() if path.is_dir())


def test_there_are_folders_of_each_day_of_the_first_week() -> None:
    assert len(VERSIONS) == 6


@pytest.mark.parametrize("version", VERSIONS)
def test_a_folder_of_an_earlier_version_opens_and_all_its_lines_count(version: str, tmp_path: Path) -> None:
    shutil.copytree(OLDER / version, tmp_path / "m")
    folder = MachineFolder(tmp_path / "m")
    lines = [json.loads(line) for line in (folder.path / "journal.jsonl").read_text("utf-8").splitlines()]
    kinds = Counter(line["kind"] for line in lines)
    contents = folder.contents()
    assert folder.machine.machine.name
    assert folder.journal.read().faults == []
    assert {remark.code for remark in contents.remarks} == {"tap-damaged"}  # the tap files are not kept here
    assert len(contents.lost) == kinds["tap"] > 2
    assert (len(contents.cuts), len(contents.acknowledgements)) == (kinds["cut"], kinds["ack"])
    assert len(contents.events) == sum(line["kind"] == "event" and "id" in line for line in lines) - (
        kinds["event"] > 0
    )
    assert sum(bool(tap.excluded) for tap in contents.lost) == kinds["exclude"] - kinds["include"]


@pytest.mark.parametrize("version", VERSIONS)
def test_a_folder_of_an_earlier_version_is_added_to_and_nothing_of_it_changes(version: str, tmp_path: Path) -> None:
    shutil.copytree(OLDER / version, tmp_path / "m")
    folder, before = MachineFolder(tmp_path / "m"), (OLDER / version / "journal.jsonl").read_bytes()
    add_event(folder, "greased")
    for tap in [tap for tap in folder.contents().lost if tap.excluded]:
        include_entry(folder, tap.id)
    assert (folder.path / "journal.jsonl").read_bytes().startswith(before)
    assert not any(tap.excluded for tap in folder.contents().lost)
    assert {remark.code for remark in verify(folder.path).damage} == {"tap-damaged"}
