"""Files of the first version are always read; files of an unknown newer version are rejected with one sentence."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest

from acquisition import DataError, TapTest, read_tap
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.rebuild_files import rebuild_files
from lobewatch.machine.verify_files import verify

VERSION_1 = Path(__file__).parents[2] / "data" / "version_1" / "machine"
MakeTap = Callable[..., TapTest]


@pytest.fixture
def old(tmp_path: Path) -> MachineFolder:
    shutil.copytree(VERSION_1, tmp_path / "old")
    return MachineFolder(tmp_path / "old")


def test_a_folder_of_version_1_is_read_verified_and_added_to(old: MachineFolder, make_tap: MakeTap) -> None:
    assert verify(old.path).remarks == ()
    x, y = (old.read(entry) for entry in old.taps())
    assert (x.circumstances.direction, y.circumstances.direction) == ("x", "y")
    assert (len(x.hits), x.circumstances.operator, x.required_frf.n_averages) == (2, "Kim", 2)
    assert x.hits[0].force.max() == pytest.approx(500, rel=0.02)
    old.commit(make_tap(3))
    assert len(MachineFolder(old.path).taps()) == 3
    assert verify(old.path).damage == ()


def test_a_folder_of_version_1_without_its_journal_is_rebuilt(old: MachineFolder) -> None:
    (old.path / "journal.jsonl").unlink()
    assert len(old.taps()) == 2
    rebuild_files(old.path)
    assert verify(old.path).remarks == ()
    assert len(MachineFolder(old.path).taps()) == 2


def test_a_newer_version_is_rejected_in_a_sentence(folder: MachineFolder) -> None:
    path = folder.path / "taps" / "tap_1.h5"
    with h5py.File(path, "r+") as file:
        file.attrs["version"] = 9
    with pytest.raises(DataError, match=r"version 9.* 2\b"):
        read_tap(path)


def test_a_tap_of_a_newer_version_is_left_out_and_reported(
    folder: MachineFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = read_tap

    def newer(path: Path) -> TapTest:
        if path.name == "tap_1.h5":
            raise DataError(f"{path}: version 9")
        return read(path)

    monkeypatch.setattr("lobewatch.machine.folder.read_tap", newer)
    logbook = Logbook.open(folder.path)
    assert [row.tap_id for row in logbook.history.rows] == ["tap_0", "tap_2"]
    (remark,) = [one for one in logbook.remarks if one.code == "tap-unreadable"]
    assert str(remark).startswith("taps/tap_1.h5: version 9")
    assert verify(folder.path).damage == ()
