"""Damaged recordings of test cuts: reported and repaired, while their evaluation still counts."""

from __future__ import annotations

import random
import shutil
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from acquisition import Channel
from acquisition.files.cut_file import CutSignal
from lobewatch.cli import app
from lobewatch.logbook import Logbook
from lobewatch.machine.folder_updates import make_observed_cut, store_cut
from lobewatch.machine.rebuild_files import rebuild_files
from lobewatch.machine.settings.requested_cut import find_cut_setting
from lobewatch.machine.verify_files import verify

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
CHANNEL = Channel("acceleration", 1.02e-2, 5.0)
CODES = np.random.default_rng(0).integers(-900, 900, 3000).astype(np.int32)


@pytest.fixture
def heard(shop: Shop) -> Path:
    """Return a tapped machine with two recorded cuts."""
    shop.run(("A", 12000, 2.0))
    shop.tap_both()
    for speed in (12000.0, 11000.0):
        cut = make_observed_cut(find_cut_setting(shop.folder.machine, "A", speed, 2.0), "chatter", None)
        signal = CutSignal(np.asarray(CODES * CHANNEL.scale, np.float64), 51200.0, CODES, CHANNEL)
        store_cut(shop.folder, replace(cut, by="accelerometer"), signal)
    path: Path = shop.path
    return path


def damage(file: Path, chance: random.Random) -> None:
    """One kind of damage; in every fourth file its seal is gone as well."""
    spoilt = bytearray(file.read_bytes())
    at = chance.randrange(len(spoilt))
    match chance.choice(("bit", "cut", "zeros")):
        case "bit":
            spoilt[at] ^= 1 << chance.randrange(8)
        case "cut":
            del spoilt[at:]
        case _:
            part = slice(at, at + chance.choice((1, 8, 64, 512)))
            spoilt[part] = bytes(len(spoilt[part]))
    file.write_bytes(spoilt[:-100] if chance.random() < 0.25 else spoilt)


def forget(path: Path) -> None:
    """Enter recordings from their own data after the journal is lost."""
    for name in ("journal.jsonl", "journal.copy.jsonl"):
        (path / name).unlink()


def one_round(heard: Path, work: Path, seed: int) -> str:
    """Damage the recording of a copy, and mend it; "named" or "equal", else what went wrong."""
    shutil.rmtree(work, ignore_errors=True)
    shutil.copytree(heard, work)
    chance, file, content = random.Random(seed), work / "cuts" / "c1.h5", (heard / "cuts" / "c1.h5").read_bytes()
    damage(file, chance)
    is_equal, is_forgotten = file.read_bytes() == content, chance.random() < 0.3
    if is_forgotten:
        forget(work)
    elif ("cuts/c1.h5" in {remark.about for remark in verify(work).damage}) == is_equal:
        return f"silent, seed {seed}"
    before = [cut.id for cut in Logbook.open(work).cuts]
    rebuild_files(work)
    if verify(work).damage:
        return f"not mended, seed {seed}"
    wanted = before if not is_forgotten else ["c1", "c2"] if is_equal else ["c2"]
    if [cut.id for cut in Logbook.open(work).cuts] != wanted:
        return f"other cuts, seed {seed}"
    return "equal" if is_equal else "named"


def damaged_rounds(heard: Path, work: Path, rounds: int) -> Counter[str]:
    return Counter(one_round(heard, work, seed) for seed in range(rounds))


def test_damaged_recordings_are_named_and_mended(heard: Path, tmp_path: Path) -> None:
    found = damaged_rounds(heard, tmp_path / "work", 60)
    assert set(found) <= {"named", "equal"}
    assert found["named"] >= 50


@pytest.mark.long
@pytest.mark.timeout(1200)
def test_six_hundred_damaged_recordings_are_named_and_mended(heard: Path, tmp_path: Path) -> None:
    found = damaged_rounds(heard, tmp_path / "work", 600)
    assert set(found) <= {"named", "equal"}
    assert found["named"] >= 500


def test_a_damaged_recording_alters_nothing_that_is_reported(heard: Path) -> None:
    """The evaluation is stored in the journal."""

    def said() -> list[tuple[int, str]]:
        commands = (["history", "--json"], ["check", "--json"], ["suggest", "--program", "A", "--json"])
        ends = [CliRunner().invoke(app, [name, str(heard), *more], catch_exceptions=False) for name, *more in commands]
        return [(end.exit_code, end.stdout) for end in ends]

    whole = said()
    assert [code for code, _ in whole] == [0, 1, 0]  # the program chatters
    damage(heard / "cuts" / "c1.h5", random.Random(0))
    assert verify(heard).damage
    assert said() == whole
