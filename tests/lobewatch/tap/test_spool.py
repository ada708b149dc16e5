"""Damaged files of an interrupted test: set aside, reported once, and the test goes on with the others."""

from __future__ import annotations

import random
import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from acquisition import (
    Channel,
    Circumstances,
    HammeredStructure,
    Hit,
    HitFlags,
    HitVerdict,
    evaluate_hit,
    read_tap,
    read_tap_hits,
)
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.hit_loop import TapStopped
from lobewatch.tap.session import TapSession
from lobewatch.tap.state import TapState
from lobewatch.tap.tap_in_progress import TapInProgress, begin_tap

Tapper = Callable[..., HammeredStructure]
Pair = tuple[Channel, Channel]
Simulate = Callable[..., Any]
OpenSession = Callable[..., TapSession]


def flipped(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 1]) + content[middle + 1 :]


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "one bit": flipped,
    "half": lambda content: content[: len(content) // 2],
    "empty": lambda _: b"",
    "zeros at its end": lambda content: content[:-20_000] + bytes(20_000),
    "another file": lambda _: b"no hit",
}


@pytest.fixture
def interrupted(
    open_folder: MachineFolder, tapper: Tapper, channels: Pair, simulated: Simulate, session_of: OpenSession
) -> Path:
    """Return the stored hits of a test that was stopped after four good hits."""

    def stop(state: TapState) -> None:
        if state.good == 4:
            session.stop()

    session: TapSession = session_of(open_folder, lambda: simulated(tapper(), channels), stop)
    with pytest.raises(TapStopped):
        session.run()
    (spool,) = open_folder.spool.iterdir()
    return spool


@pytest.fixture
def go_on(
    open_folder: MachineFolder, tapper: Tapper, channels: Pair, simulated: Simulate, session_of: OpenSession
) -> Callable[[], TapSession]:
    """Return a function that makes a session which resumes that test."""
    return lambda: session_of(open_folder, lambda: simulated(tapper(2), channels))


def begun_again(folder: MachineFolder) -> TapInProgress:
    return begin_tap(folder, Circumstances("m", datetime.now(UTC), "reference"))


def damage(path: Path, how: Callable[[bytes], bytes] = flipped) -> bytes:
    content = how(path.read_bytes())
    path.write_bytes(content)
    return content


@pytest.mark.parametrize("how", DAMAGES)
@pytest.mark.parametrize("number", [0, 1, 3])
def test_a_damaged_hit_is_set_aside_and_the_others_are_resumed(
    how: str, number: int, interrupted: Path, open_folder: MachineFolder
) -> None:
    content = damage(interrupted / f"{number:04d}.h5", DAMAGES[how])
    tap = begun_again(open_folder)
    (aside,) = tap.damaged
    assert aside == open_folder.spool / f"{interrupted.name}-{number:04d}.h5.damaged"
    assert aside.read_bytes() == content
    assert tap.id == interrupted.name
    assert tap.numbers == [other for other in range(4) if other != number]
    assert begun_again(open_folder).damaged == []


def test_it_is_reported_once_kept_after_the_end_and_no_sound_hit_is_written_over(
    interrupted: Path, open_folder: MachineFolder, go_on: Callable[[], TapSession]
) -> None:
    damage(interrupted / "0001.h5")
    kept = [read_tap_hits(interrupted / f"{number:04d}.h5")[0][0].force.max() for number in (0, 2, 3)]
    session = go_on()
    tap = session.run()
    said = session.state.resumed
    assert said.count("3 of 10") == 1
    assert said.count(f"{interrupted.name}-0001.h5.damaged") == 1
    stored = read_tap(open_folder.path / "taps" / f"{tap.id}.h5")
    assert len(stored.hits) == 10
    assert [hit.force.max() for hit in stored.hits[:3]] == kept
    assert [path.suffix for path in open_folder.spool.iterdir()] == [".damaged"]


def test_a_test_of_which_nothing_is_left_is_restarted_and_that_is_reported(
    interrupted: Path, open_folder: MachineFolder, go_on: Callable[[], TapSession]
) -> None:
    for path in interrupted.glob("*.h5"):
        damage(path)
    session = go_on()
    assert session.run().id != interrupted.name
    assert session.state.resumed.count(".h5.damaged") == 4


def test_a_damaged_set_up_is_chosen_again(interrupted: Path, open_folder: MachineFolder) -> None:
    damage(interrupted / "setup.json", lambda content: content[:-5])
    tap = begun_again(open_folder)
    assert tap.trigger is None
    assert len(tap.hits) == 4
    assert [path.name for path in tap.damaged] == [f"{interrupted.name}-setup.json.damaged"]


def test_a_hit_withdrawn_after_another_was_set_aside_is_that_hit(interrupted: Path, open_folder: MachineFolder) -> None:
    damage(interrupted / "0000.h5")
    begun_again(open_folder).exclude(1, HitFlags.UNDONE, "")
    again = begun_again(open_folder)
    assert again.flags == [HitFlags.OK, HitFlags.UNDONE, HitFlags.OK]
    assert again.numbers == [1, 2, 3]


def test_hits_spooled_before_there_were_checksums_are_read(interrupted: Path, open_folder: MachineFolder) -> None:
    for path in interrupted.glob("*.h5"):
        content = path.read_bytes()
        path.write_bytes(content[: content.rindex(b"\nlobewatch sha256 ")])
    tap = begun_again(open_folder)
    assert len(tap.hits) == 4
    assert tap.damaged == []


def test_a_disk_that_cannot_be_read_is_no_damaged_hit(
    interrupted: Path, open_folder: MachineFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(path: Path, *_: object) -> bytes:
        raise OSError(5, "Input/output error", str(path))

    monkeypatch.setattr("lobewatch.tap.spool.read_regular_file", fail)
    with pytest.raises(OSError, match="Input/output error"):
        begun_again(open_folder)
    assert (interrupted / "0000.h5").is_file()


def test_a_spooled_hit_on_which_the_judging_fails_counts_no_more_and_the_others_do(
    interrupted: Path, open_folder: MachineFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    failures = iter([ZeroDivisionError("no lines")])

    def once(hit: Hit) -> HitVerdict:
        for failure in failures:
            raise failure
        return evaluate_hit(hit)

    monkeypatch.setattr("lobewatch.tap.tap_in_progress.evaluate_hit", once)
    tap = begun_again(open_folder)
    assert tap.flags == [HitFlags.NOT_EVALUATED, HitFlags.OK, HitFlags.OK, HitFlags.OK]
    assert "ZeroDivisionError: no lines" in tap.reasons[0]


def test_what_was_set_aside_is_never_written_over(interrupted: Path, open_folder: MachineFolder) -> None:
    sound = (interrupted / "0003.h5").read_bytes()
    first = damage(interrupted / "0003.h5")
    begun_again(open_folder)
    (interrupted / "0003.h5").write_bytes(sound[: len(sound) // 2])
    begun_again(open_folder)
    asides = sorted(open_folder.spool.glob("*.damaged"))
    assert sorted(path.read_bytes() for path in asides) == sorted([first, sound[: len(sound) // 2]])


def test_no_hit_counts_twice(interrupted: Path, open_folder: MachineFolder) -> None:
    (interrupted / "0004.h5").write_bytes((interrupted / "0001.h5").read_bytes())
    tap = begun_again(open_folder)
    assert tap.numbers == [0, 1, 2, 3]
    assert [path.name for path in tap.damaged] == [f"{interrupted.name}-0004.h5.damaged"]


def test_an_altered_figure_of_the_set_up_is_found(interrupted: Path, open_folder: MachineFolder) -> None:
    told = (interrupted / "setup.json").read_text()
    level = re.search(r'"level": (\d)', told)
    assert level is not None
    other = str((int(level[1]) + 1) % 10)
    (interrupted / "setup.json").write_text(told[: level.start(1)] + other + told[level.end(1) :])
    assert begun_again(open_folder).trigger is None


def test_other_interrupted_tests_are_reported_and_kept(
    interrupted: Path, open_folder: MachineFolder, go_on: Callable[[], TapSession]
) -> None:
    later = datetime.now(UTC) + timedelta(hours=13)
    for about in (Circumstances("m", later, "reference"), Circumstances("m", datetime.now(UTC), "reference", "y")):
        tap = begin_tap(open_folder, about)
        assert tap.hits == []
        assert len(tap.not_resumed) == 1
        assert str(interrupted) in tap.not_resumed[0]
    second = begin_tap(open_folder, Circumstances("m", datetime.now(UTC), "reference"), resume=False)
    assert (second.hits, len(second.not_resumed)) == ([], 1)
    assert len(list(interrupted.glob("*.h5"))) == 4


def test_half_written_files_and_empty_folders_are_removed(interrupted: Path, open_folder: MachineFolder) -> None:
    (interrupted / ".0004.h5.abcd.tmp").write_bytes(b"half")
    (open_folder.path / ".history.rows.abcd.tmp").write_bytes(b"half")
    (open_folder.path / ".report.html.abcd.tmp").write_bytes(b"of a program without the lock")
    (open_folder.spool / "empty").mkdir()
    (open_folder.spool / "without hits").mkdir()
    (open_folder.spool / "without hits" / "setup.json").write_text("{}")
    assert len(begun_again(open_folder).hits) == 4
    assert [path.name for path in open_folder.spool.iterdir()] == [interrupted.name]
    assert sorted(path.suffix for path in interrupted.iterdir()) == [".h5"] * 4 + [".json"]
    assert [path.name for path in open_folder.path.glob(".*.tmp")] == [".report.html.abcd.tmp"]


def test_hits_of_a_committed_test_are_removed(
    interrupted: Path, open_folder: MachineFolder, go_on: Callable[[], TapSession]
) -> None:
    kept = {path.name: path.read_bytes() for path in interrupted.iterdir()}
    go_on().run()
    interrupted.mkdir()
    for name, content in kept.items():
        (interrupted / name).write_bytes(content)
    assert begun_again(open_folder).hits == []
    assert not interrupted.exists()


def resumed(spool: Path, folder: MachineFolder, seed: int) -> bool:
    """Return whether a test with one flipped bit or a truncated file resumes with all that is intact."""
    chance = random.Random(seed)
    sound = {path: path.read_bytes() for path in spool.iterdir()}
    path = chance.choice(sorted(sound))
    at = chance.randrange(len(sound[path]))
    flip = bytes([sound[path][at] ^ 1 << chance.randrange(8)])
    path.write_bytes(sound[path][:at] + (b"" if seed % 4 == 0 else flip + sound[path][at + 1 :]))
    tap = begun_again(folder)
    for name, content in sound.items():
        name.write_bytes(content)
    count = len(sound) - 1
    return tap.id == spool.name and len(tap.hits) >= count - 1 and len(tap.hits) + len(tap.damaged) >= count


def test_damaged_tests_are_resumed(interrupted: Path, open_folder: MachineFolder) -> None:
    assert all(resumed(interrupted, open_folder, seed) for seed in range(12))


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_130_damaged_tests_are_resumed(interrupted: Path, open_folder: MachineFolder) -> None:
    assert sum(resumed(interrupted, open_folder, seed) for seed in range(130)) == 130
