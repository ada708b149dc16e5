"""Trust in modes that repeat is counted over the files of a structure."""

from __future__ import annotations

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import public_files
import pytest
import repeating_modes

F = np.arange(1.0, 400.0)


def put(file: Path, *frequencies: float) -> None:
    """Write a receptance with these modes."""
    file.parent.mkdir(parents=True, exist_ok=True)
    h = np.sum([1 / (4e8 * (1 - (F / own) ** 2 + 0.02j * F / own)) for own in frequencies], axis=0)
    file.write_text("".join(f"{f:g}\t{v.real:.9e}\t{v.imag:.9e}\n" for f, v in zip(F, h, strict=True)), "utf-8")


def test_a_mode_of_half_of_the_points_repeats(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / public_files.SIGNALS / "ExperimentalModalAnalysis"
    put(folder / "Point_1.txt", 150.0, 300.0)
    put(folder / "Point_2.txt", 150.0)
    put(folder / "Point_3.txt", 150.5)
    put(folder / "Point_4.txt", 250.0)
    put(folder / "Point_5.txt", 300.0)
    monkeypatch.setattr(sys, "argv", ["repeating_modes.py", str(tmp_path)])
    repeating_modes.main()
    *_, row = capsys.readouterr().out.splitlines()
    assert row == "| tool | 5 | 1.00 of 3 | 1.00 of 3 | 1.00 of 3 | 0.67 of 3 |"


@pytest.mark.parametrize(("count", "beside"), [(2, "0.00"), (3, "1.00")])
def test_each_file_is_read_next_to_all_others_where_there_are_two(
    count: int, beside: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def read(file: Path, words: list[str]) -> public_files.Reading:
        others = {Path(word).name for flag, word in pairwise(words) if flag == "--beside"}
        return public_files.Reading(((150.0, len(others - {file.name}) == 2),), "")

    folder = tmp_path / public_files.SIGNALS / "ExperimentalModalAnalysis"
    monkeypatch.setattr(repeating_modes, "read", read)
    monkeypatch.setattr(sys, "argv", ["repeating_modes.py", str(tmp_path)])
    for place in range(count):
        put(folder / f"Point_{place}.txt", 150.0)
    repeating_modes.main()
    *_, row = capsys.readouterr().out.splitlines()
    assert row == f"| tool | {count} | 0.00 of {count} | none | {beside} of {count} | none |"
