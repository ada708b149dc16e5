"""A replay gives the results of a live test, in any process, bit by bit."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from acquisition import (
    Channel,
    Circumstances,
    DataError,
    Description,
    HammeredStructure,
    HitFlags,
    SimulatedSource,
    TapTest,
    Trigger,
    average_good_hits,
    capture_hits,
    new_tap_id,
    write_tap,
)
from lobewatch import Logbook
from lobewatch.history import HistoryRow
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.machine.row_file import read_rows
from lobewatch.measurement.share_work import Workers
from modal import Mode, synthesize_frf
from tests.lobewatch.conftest import Shop

LINES = np.arange(1202.0, 2200.0, 4.0)


def values(row: HistoryRow) -> str:
    """All of a row but for the name of its tap test, to the last digit."""
    return repr(replace(row, tap_id="", series="", time=row.time.astimezone(UTC)))


def text_files(folder: Path, count: int) -> list[Path]:
    folder.mkdir()
    for day in range(count):
        h = synthesize_frf([Mode(1713.0 - day, 0.03, 3.5e7)], LINES).receptance
        rows = np.column_stack((LINES, h.real, h.imag))
        head = "Freq (Hz),Real (m/N),Imag (m/N)"
        np.savetxt(folder / f"2026-01-{day + 1:02d}.csv", rows, delimiter=",", header=head, comments="")
    return sorted(folder.iterdir())


def test_a_live_test_replayed_gives_equal_modes_and_words(
    shop: Shop, tmp_path: Path, tapper: Callable[..., HammeredStructure], channels: tuple[Channel, Channel]
) -> None:
    shop.run(("A", 12900, 1.0))
    hits = tuple(capture_hits(SimulatedSource(tapper(), channels, 25600.0, 100_000), Trigger(20.0, 6400, 512)))
    frf, flags = average_good_hits(hits)
    about = Circumstances(
        "m", datetime(2026, 1, 15, tzinfo=UTC), "reference", machine_toml=shop.folder.toml.read_text()
    )
    live = TapTest(new_tap_id(about), about, frf, hits, flags)
    shop.logbook.commit(live)
    (path,) = (shop.path / "taps").iterdir()
    make_machine_folder(tmp_path / "other", "surrogate_machine.toml")
    (tmp_path / "other" / "machine.toml").write_text(shop.folder.toml.read_text())
    other = Logbook.open(tmp_path / "other")
    again = other.replay(path)
    first = shop.logbook.measurement(live.id)
    assert len(first.modes) > 1
    for mine, its in zip(first.modes, again.modes, strict=True):
        assert repr(mine) == repr(its)
    assert values(shop.logbook.history.rows[-1]) == values(other.history.rows[-1])
    assert other.history.rows[-1].verdicts
    assert keeps_source(other, path) == b""
    taken_back = replace(live, id=new_tap_id(about), flags=(HitFlags.UNDONE, *flags[1:]))
    write_tap(tmp_path / "taken back.h5", taken_back)
    other.replay(tmp_path / "taken back.h5")
    assert keeps_source(other, tmp_path / "taken back.h5") == (tmp_path / "taken back.h5").read_bytes()


def keeps_source(logbook: Logbook, file: Path) -> bytes:
    """Return the stored bytes of a replayed file; its SHA-256 is known again."""
    tap_id = logbook.replay_all([file], Description()).already_stored[file]
    entry = next(tap for tap in logbook.taps if tap.id == tap_id)
    source = logbook.folder.read(entry).source
    assert source is not None
    assert (source.name, source.sha256) == (file.name, hashlib.sha256(file.read_bytes()).hexdigest())
    if not source.content:
        assert entry.size < 1.05 * file.stat().st_size
    return source.content


def test_several_processes_find_the_same_and_leave_nothing_behind(tmp_path: Path) -> None:
    files, found = text_files(tmp_path / "files", 5), []
    for jobs in (1, 2):
        make_machine_folder(tmp_path / str(jobs), "surrogate_machine.toml")
        logbook = Logbook.open(tmp_path / str(jobs))
        stored = logbook.replay_all(files, Description(date_pattern="%Y-%m-%d"), workers=Workers(jobs))
        assert len(stored.new_tap_ids) == len(files)
        found.append([*map(values, logbook.history.rows)])
        names = {path.name for path in (tmp_path / str(jobs) / "taps").iterdir()}
        assert names == {f"{tap_id}.h5" for tap_id in stored.new_tap_ids}
        assert not MachineFolder(tmp_path / str(jobs)).contents().remarks
    assert found[0] == found[1]


def test_an_interrupted_replay_is_cleared_away_and_done_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    files = text_files(tmp_path / "files", 3)
    make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    taps = tmp_path / "m" / "taps"
    taps.mkdir(exist_ok=True)
    (taps / ".a.h5.ready").write_bytes(b"left over")
    said = Description(date_pattern="%Y-%m-%d")
    files[1].write_text("no frequencies\n")
    with pytest.raises(DataError, match="1 of 3 files"):
        Logbook.open(tmp_path / "m").replay_all(files, said)
    assert list(taps.iterdir()) == []
    with monkeypatch.context() as patch:
        patch.setattr("lobewatch.machine.journal.journal.Journal.append", _ended)
        with pytest.raises(KeyboardInterrupt):
            Logbook.open(tmp_path / "m").replay_all(files[::2], said)
    stored = Logbook.open(tmp_path / "m").replay_all(files[::2], said)
    assert (len(stored.already_stored), len(stored.new_tap_ids)) == (1, 1)
    assert [tap.time for tap in MachineFolder(tmp_path / "m").taps()] == sorted(
        tap.time for tap in MachineFolder(tmp_path / "m").taps()
    )
    assert len(list(taps.iterdir())) == 2


def test_a_killed_replay_keeps_the_stored_tests_with_their_rows_and_continues(tmp_path: Path) -> None:
    files, said = text_files(tmp_path / "files", 4), Description(date_pattern="%Y-%m-%d")
    make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    folder, on_disk = MachineFolder(tmp_path / "m"), list[int]()

    def kill_after_two(step: str, done: int, _of: int) -> None:
        if step == "store":
            on_disk.append(len(folder.committed_ids))
            assert on_disk[-1] == done
        if done == 2 and step == "store":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        Logbook.open(tmp_path / "m").replay_all(files, said, progress=kill_after_two)
    assert on_disk == [0, 1, 2]
    assert len(read_rows(folder.history_path).rows) > 1
    assert list((tmp_path / "m" / "taps").glob(".*")) == []
    logbook = Logbook.open(tmp_path / "m")
    stored = logbook.replay_all(files, said)
    assert [*stored.already_stored] == files[:2]
    assert [tap.id for tap in folder.taps()][2:] == stored.new_tap_ids
    make_machine_folder(tmp_path / "whole", "surrogate_machine.toml")
    whole = Logbook.open(tmp_path / "whole")
    whole.replay_all(files, said)
    assert [*map(values, logbook.history.rows)] == [*map(values, whole.history.rows)]


def _ended(*_: object, **__: object) -> None:
    raise KeyboardInterrupt
