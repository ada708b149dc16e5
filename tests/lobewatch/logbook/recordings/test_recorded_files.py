"""Recorded files are found by path, folder and pattern, and dated by their names."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from acquisition import DataError
from lobewatch.logbook.recordings.recorded_files import find_recordings, parse_date_in_name
from lobewatch.logbook.recordings.store_recordings import format_rejections, group_by_message

pytestmark = pytest.mark.quick


@pytest.mark.parametrize(
    ("name", "pattern", "date"),
    [
        ("tap_20240501.csv", "%Y%m%d", "2024-05-01T00:00:00"),
        ("3.7.24 x.mat", "%d.%m.%y", "2024-07-03T00:00:00"),
        ("2024-May-02_0915.lvm", "%Y-%b-%d_%H%M", "2024-05-02T09:15:00"),
    ],
)
def test_a_date_in_a_name_is_found(name: str, pattern: str, date: str) -> None:
    assert parse_date_in_name(Path(name), pattern).replace(tzinfo=None).isoformat() == date


@pytest.mark.parametrize(("pattern", "fact"), [("%Q", "%Y, %y"), ("%Y%m%d", "tap.csv")])
def test_a_name_without_a_date_and_a_pattern_without_a_directive_are_rejected(pattern: str, fact: str) -> None:
    with pytest.raises(ValueError, match=rf"Description\.date_pattern '{pattern}' .*{fact}"):
        parse_date_in_name(Path("tap.csv"), pattern)


def test_files_of_a_folder_are_recordings_or_skipped(tmp_path: Path) -> None:
    for name, text in (("a.csv", "1,2\n3,4\n"), ("b.pdf", "x"), (".c.csv", "1,2\n")):
        (tmp_path / name).write_text(text, "utf-8")
    assert find_recordings([tmp_path]) == ([tmp_path / "a.csv"], [tmp_path / "b.pdf"])
    assert find_recordings([tmp_path / "a.csv", tmp_path / "*.pdf"])[0] == [tmp_path / "a.csv", tmp_path / "b.pdf"]
    with pytest.raises(DataError, match=r"\*\.mat: "):
        find_recordings([tmp_path / "*.mat"])


def test_equal_messages_are_grouped_and_many_files_counted() -> None:
    assert group_by_message([(name, "bad") for name in "abcde"]) == ["a, b, c and 2 more: bad"]
    assert re.match(r"a: bad\. 1 of 2 files .*store_recordings\.keep_going", format_rejections({Path("a"): "bad"}, 2))
    assert "keep_going" not in format_rejections({Path("a"): "bad"}, 2, stored=True)
    lines = format_rejections({Path("a"): "bad", Path("b"): "worse"}, 2).splitlines()
    assert lines[1:] == ["a: bad", "b: worse"]
    assert re.search(r"\b2 files", lines[0])


def test_files_of_a_folder_and_a_pattern_follow_their_numbers(tmp_path: Path) -> None:
    names = ["hit_1.csv", "hit_2.csv", "hit_10.csv", "hit_010.csv", "run 9/1.csv", "run 10/1.csv"]
    for name in names:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("1,2\n3,4\n", "utf-8")
    expected = [tmp_path / name for name in [*names[:2], "hit_010.csv", "hit_10.csv", *names[4:]]]
    assert find_recordings([tmp_path])[0] == expected
    assert find_recordings([f"{tmp_path}/hit_*.csv"])[0] == expected[:4]


def test_a_file_is_repeated_only_on_request(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("1,2\n3,4\n", "utf-8")
    places = [tmp_path / "a.csv", tmp_path, tmp_path / "a.csv"]
    assert find_recordings(places)[0] == [tmp_path / "a.csv"]
    assert find_recordings(places, repeated=True)[0] == [tmp_path / "a.csv"] * 3
