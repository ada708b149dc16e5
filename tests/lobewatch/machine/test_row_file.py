"""Rows with checksums: truncated or altered rows are skipped and overwritten, earlier rows are read."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from lobewatch.machine.row_file import append_rows, read_rows, write_rows

ROWS = [b"head", b"a" * 300, bytes(range(256)), b"\0"]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_rows(tmp_path / "rows", ROWS)
    return tmp_path / "rows"


def test_what_is_added_is_read_behind_the_others_and_the_others_are_not_written(path: Path) -> None:
    before, number = path.read_bytes(), path.stat().st_ino
    found = read_rows(path)
    assert (found.rows, found.sound_bytes, found.is_damaged) == (tuple(ROWS), len(before), False)
    size = append_rows(path, found.sound_bytes, [b"new", b"newer"])
    assert path.read_bytes()[: len(before)] == before
    assert (path.stat().st_size, path.stat().st_ino) == (size, number)
    assert read_rows(path).rows == (*ROWS, b"new", b"newer")


def test_a_row_torn_by_a_crash_counts_for_nothing_and_is_written_over(path: Path) -> None:
    whole = path.read_bytes()
    for cut in range(len(whole) - 8, len(whole)):
        path.write_bytes(whole[:cut])
        found = read_rows(path)
        assert (found.rows, found.is_damaged) == (tuple(ROWS[:-1]), False)
        append_rows(path, found.sound_bytes, [b"again"])
        assert read_rows(path).rows == (*ROWS[:-1], b"again")


def test_zeros_of_a_power_cut_are_no_rows(path: Path) -> None:
    path.write_bytes(path.read_bytes() + bytes(4096))
    assert read_rows(path).rows == tuple(ROWS)


def test_an_altered_row_is_not_believed_nor_what_is_behind_it(path: Path) -> None:
    whole, chance = path.read_bytes(), random.Random(0)
    for _ in range(500):
        at, bit = chance.randrange(len(whole)), chance.randrange(8)
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 1 << bit]) + whole[at + 1 :])
        found = read_rows(path).rows
        assert found == tuple(ROWS[: len(found)])
        assert len(found) < len(ROWS)
