"""Copies of a machine folder: named by status, fleet and tap, at any depth of the copied journal."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

import pytest

from lobewatch.fleet.copied_folders import find_copies, read_first_tap
from lobewatch.fleet.fleet import Fleet, find_machines
from lobewatch.monitoring.status_rules import StatusLevel

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""


@pytest.fixture
def mills(shop: Shop, tmp_path: Path) -> Path:
    """Make two copies of one machine, one of them tapped again, and two other machines."""
    shop.put("")
    shop.tap_both()
    for name in ("original", "copy"):
        shutil.copytree(shop.path, tmp_path / "mills" / name)
    type(shop)(tmp_path / "mills" / "untapped")
    other = type(shop)(tmp_path / "mills" / "other")
    other.tap(3.0, 1713.0)
    shop.path = tmp_path / "mills" / "original"
    shop.tap(2.0, 1713.0)
    return tmp_path / "mills"


def copies(machines: dict[str, Path]) -> dict[str, set[str]]:
    return {key: {word.strip(",") for word in remark.text.split()} for key, remark in find_copies(machines).items()}


def test_a_copy_is_named_with_its_original(mills: Path) -> None:
    found = find_copies(find_machines(mills))
    assert {key: remark.code for key, remark in found.items()} == dict.fromkeys(("copy", "original"), "folder-copied")
    assert "original" in found["copy"].text
    assert "copy" in found["original"].text


def test_the_status_names_it_and_its_level_stays(mills: Path, shop: Shop) -> None:
    found = {one.key: one.current for one in Fleet(find_machines(mills)).assess_machines(shop.start)}
    named = {key for key, current in found.items() if "folder-copied" in {one.code for one in current.remarks}}
    assert named == {"copy", "original"}
    assert found["copy"].status is StatusLevel.GOOD
    (alone,) = Fleet({"m": shutil.copytree(mills / "copy", mills / "elsewhere" / "m")}).assess_machines(shop.start)
    assert alone.current.remarks == ()
    assert found["copy"].next_step == alone.current.next_step


def test_one_machine_is_compared_with_its_neighbours(mills: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (mills / "a file").write_text("no folder")
    assert "original" in find_copies({"copy": mills / "copy"})["copy"].text
    assert find_copies({"other": mills / "other"}) == {}
    assert find_copies({"untapped": mills / "untapped"}) == {}
    monkeypatch.chdir(mills / "copy")
    assert "original" in find_copies({"copy": Path()})["copy"].text


def test_a_link_to_a_folder_is_no_copy(mills: Path) -> None:
    (mills / "link").symlink_to(mills / "other")
    (mills / "link to a copy").symlink_to(mills / "copy")
    found = copies(find_machines(mills))
    assert set(found) == {"copy", "original", "link to a copy"}
    assert "original" in found["copy"] & found["link to a copy"]
    assert "link" not in found["copy"]
    for one in ("other", "link"):
        assert find_copies({one: mills / one}) == {}


def test_many_copies_are_counted(mills: Path) -> None:
    for number in range(5):
        shutil.copytree(mills / "copy", mills / f"c{number}")
    assert find_copies(find_machines(mills))["copy"].text.endswith("c0, c1, c2, 3 more")


def test_no_journal_blocks_the_search(mills: Path) -> None:
    (mills / "pipe").mkdir()
    os.mkfifo(mills / "pipe" / "journal.jsonl")
    (mills / "untapped" / "journal.jsonl").write_bytes(b'"kind": "tap"\n')
    assert read_first_tap(mills / "pipe") == read_first_tap(mills / "untapped") == ("", "")
    assert set(find_copies(find_machines(mills))) == {"copy", "original"}
