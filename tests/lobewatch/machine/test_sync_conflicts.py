"""Files of another computer in a synced folder: each fact announced there counts or is named, and nothing is lost."""

from __future__ import annotations

import os
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition import Circumstances, SourceFile, TapTest
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_updates import (
    add_event,
    exclude_entry,
    include_entry,
    make_observed_cut,
    store_cut,
    withdraw_event,
)
from lobewatch.machine.rebuild_files import rebuild_files
from lobewatch.machine.settings.requested_cut import find_cut_setting
from lobewatch.machine.verify_files import verify
from lobewatch.monitoring.status_rules import STATUS_BY_CODE, StatusLevel
from tests.lobewatch.machine.synced_folders import (
    CONFLICT_NAMES,
    FRF,
    TwoCopies,
    find_remaining_problems,
    read_files,
)

NAMES = ("journal.jsonl", "journal.copy.jsonl")
ACTIONS = ("tap", "event", "withdraw", "exclude", "include", "accept", "modes", "hit", "cut", "mass", "ack", "program")
STEPS = st.lists(
    st.tuples(st.sampled_from((*ACTIONS, "exclude", "hit", "sync", "sync", "sync", "rebuild")), st.integers(0, 119)),
    min_size=2,
    max_size=14,
)
"""Operation, and a number that chooses its folder and its entry."""


@pytest.fixture
def two(tmp_path: Path) -> TwoCopies:
    return TwoCopies(tmp_path)


def codes(path: Path) -> list[str]:
    return [remark.code for remark in MachineFolder(path).contents().remarks]


def lines(path: Path, kind: str) -> list[dict[str, Any]]:
    return [entry for entry in MachineFolder(path).journal.read().entries if entry["kind"] == kind]


def run_steps(two: TwoCopies, steps: list[tuple[str, int]]) -> list[str]:
    """Let two people work, sync and rebuild, and return the facts that neither count nor are named."""
    for action, number in steps:
        side, rest = number % 2, number // 2
        if action == "sync":
            two.sync(side, rest % len(CONFLICT_NAMES))
        elif action == "rebuild":
            two.rebuild(side)
        else:
            two.write(side, action, rest)
    side, name = len(steps) % 2, steps[0][1] % len(CONFLICT_NAMES)
    two.sync(side, name)
    unnamed = _find_unnamed(two.paths[side])
    two.rebuild(side)
    lost = [*unnamed, *two.find_lost(side), *find_remaining_problems(two.paths[side])]
    before = read_files(two.paths[side])
    again = rebuild_files(two.paths[side])
    return lost + again + ["a second run changed files"] * (read_files(two.paths[side]) != before)


def _find_unnamed(path: Path) -> list[str]:
    """Return the journals of other computers that no remark names."""
    named = {remark.about for remark in MachineFolder(path).contents().remarks}
    return [file.name for file in path.iterdir() if "journal" in file.name and file.name not in {*named, *NAMES}]


@settings(max_examples=5)
@given(steps=STEPS)
def test_every_fact_of_two_computers_counts_or_is_named(
    tmp_path_factory: pytest.TempPathFactory, steps: list[tuple[str, int]]
) -> None:
    assert run_steps(TwoCopies(tmp_path_factory.mktemp("two")), steps) == []


@pytest.mark.long
@pytest.mark.timeout(3600)
@settings(max_examples=1000)
@given(steps=STEPS)
def test_every_fact_of_two_computers_counts_or_is_named_in_a_thousand_interleavings(
    tmp_path_factory: pytest.TempPathFactory, steps: list[tuple[str, int]]
) -> None:
    assert run_steps(TwoCopies(tmp_path_factory.mktemp("two")), steps) == []


@pytest.mark.parametrize("name", range(len(CONFLICT_NAMES)))
def test_the_other_side_is_named_whatever_its_name_and_joined_by_rebuild(two: TwoCopies, name: int) -> None:
    a, b = map(MachineFolder, two.paths)
    first, second, _ = a.taps()
    exclude_entry(b, first.id, "wrong tool")
    add_event(a, "belt changed")
    two.sync(0, name)
    conflicts = {remark.about for remark in verify(a.path).damage if remark.code == "sync-conflict"}
    assert conflicts == {CONFLICT_NAMES[name](Path(file)) for file in NAMES}
    assert codes(a.path) == ["sync-conflict"] * 2
    assert STATUS_BY_CODE["sync-conflict"] is StatusLevel.WARN
    before = (a.path / NAMES[0]).read_bytes()
    rebuild_files(a.path)
    assert (a.path / NAMES[0]).read_bytes().startswith(before)
    contents = MachineFolder(a.path).contents()
    assert contents.remarks == verify(a.path).damage == ()
    assert {tap.id: tap.excluded for tap in contents.taps}[first.id] == "wrong tool"
    assert {tap.id: tap.excluded for tap in contents.taps}[second.id] == a.taps()[1].excluded
    assert [event.text for event in contents.events] == ["belt changed"]
    assert {file.name for file in (a.path / "sync-conflicts").iterdir()} == conflicts
    assert rebuild_files(a.path) == []


@pytest.mark.skipif(sys.platform != "linux", reason="other systems store no such name")
def test_a_file_whose_name_is_no_text_is_named_and_joined(two: TwoCopies) -> None:
    a, b = map(MachineFolder, two.paths)
    add_event(b, "belt changed")
    (a.path / os.fsdecode(b"journal\xff.jsonl")).write_bytes((b.path / NAMES[0]).read_bytes())
    texts = [*map(str, verify(a.path).remarks), *map(str, a.contents().remarks)]
    assert [text.count("\\udcff.jsonl") for text in texts] == [1, 1]
    texts += rebuild_files(a.path)
    assert "".join(texts).encode()
    assert [event.text for event in MachineFolder(a.path).contents().events] == ["belt changed"]


def test_identities_of_both_sides_are_renumbered_with_all_that_names_them(two: TwoCopies) -> None:
    a, b = map(MachineFolder, two.paths)
    for folder, texts in ((a, ("greased",)), (b, ("belt", "pump"))):
        for text in texts:
            add_event(folder, text)
        setting = find_cut_setting(folder.machine, folder.machine.program[0].name, 9000.0, 1.0 + len(texts))
        store_cut(folder, make_observed_cut(setting, "chatter"))
    withdraw_event(b, "e1")
    exclude_entry(b, "c1", "misheard")
    two.sync(0, 0)
    report = " ".join(rebuild_files(a.path))
    contents = MachineFolder(a.path).contents()
    assert {event.id: event.text for event in contents.events} == {"e1": "greased", "e2": "pump"}
    assert {cut.id: (cut.depth, cut.excluded) for cut in contents.cuts} == {
        "c1": (0.002, ""),
        "c2": (0.003, "misheard"),
    }
    assert "e1 is now e3" in report
    assert "c1 is now c2" in report
    assert lines(a.path, "join")[0]["renumbered"] == {"e1": "e3", "c1": "c2"}
    assert add_event(MachineFolder(a.path), "next").id == "e4"


def test_the_same_fact_of_both_sides_counts_once(two: TwoCopies) -> None:
    a, b = map(MachineFolder, two.paths)
    when = a.taps()[0].created
    for folder in (a, b):
        add_event(folder, "belt changed", when)
        folder.accept(folder.taps()[0].id, "one-hit")
        exclude_entry(folder, folder.taps()[0].id, "wrong tool")
    two.sync(1, 1)
    rebuild_files(a.path)
    contents = MachineFolder(a.path).contents()
    assert [event.id for event in contents.events] == ["e1"]
    assert (contents.taps[0].excluded, contents.taps[0].accepted) == ("wrong tool", ("one-hit",))
    assert contents.remarks == ()


def test_a_contradiction_stays_named_until_a_person_repeats_the_right_entry(two: TwoCopies) -> None:
    a, b = map(MachineFolder, two.paths)
    tap = a.taps()[0].id
    exclude_entry(a, tap, "badly clamped")
    exclude_entry(b, tap, "wrong tool")
    two.sync(0, 2)
    rebuild_files(a.path)
    (remark,) = MachineFolder(a.path).contents().remarks
    assert (remark.code, remark.about) == ("sync-contradiction", tap)
    assert "badly clamped" in remark.text
    assert "wrong tool" in remark.text
    assert MachineFolder(a.path).taps()[0].excluded == "wrong tool"
    assert [one.code for one in verify(a.path).damage] == ["sync-contradiction"]
    exclude_entry(MachineFolder(a.path), tap, "badly clamped")
    assert codes(a.path) == []
    assert MachineFolder(a.path).taps()[0].excluded == "badly clamped"
    with pytest.raises(ValueError, match="already excluded"):
        exclude_entry(MachineFolder(a.path), tap, "again")


@pytest.mark.parametrize("kept", [0, 1])
def test_the_newer_entry_counts_whichever_side_is_kept(two: TwoCopies, kept: int) -> None:
    a, b = map(MachineFolder, two.paths)
    excluded = next(tap.id for tap in a.taps() if tap.excluded)
    exclude_entry(b, a.taps()[0].id, "first")
    include_entry(a, excluded)
    exclude_entry(a, excluded, "second")
    include_entry(b, excluded)
    two.sync(kept, 3)
    rebuild_files(a.path)
    assert [tap.excluded for tap in MachineFolder(a.path).taps()] == ["first", "", ""]


def test_a_journal_and_a_copy_of_two_sides_are_joined(two: TwoCopies) -> None:
    a, b = map(MachineFolder, two.paths)
    add_event(a, "greased")
    add_event(b, "belt")
    (a.path / NAMES[1]).write_bytes((b.path / NAMES[1]).read_bytes())
    assert codes(a.path) == ["journal-damaged"]
    rebuild_files(a.path)
    assert {event.id: event.text for event in MachineFolder(a.path).contents().events} == {
        "e1": "greased",
        "e2": "belt",
    }
    assert verify(a.path).damage == ()


def test_a_tap_test_with_the_identity_of_another_one_gets_its_own(two: TwoCopies) -> None:
    for side in (0, 1):
        two.write(side, "tap", 1)
    folder = MachineFolder(two.paths[1])
    folder.accept("tap_3", "one-hit")
    two.sync(0, 4)
    rebuild_files(two.paths[0])
    taps = {tap.id: tap for tap in MachineFolder(two.paths[0]).taps()}
    assert [taps[name].accepted for name in ("tap_3", "tap_3-2")] == [(), ("one-hit",)]
    assert MachineFolder(two.paths[0]).read(taps["tap_3-2"]).circumstances.operator == taps["tap_3-2"].operator
    assert {taps[name].operator for name in ("tap_3", "tap_3-2")} == {"no 1", "no 2"}
    assert verify(two.paths[0]).damage == ()


def test_a_recording_that_both_computers_replayed_counts_once(two: TwoCopies) -> None:
    source = SourceFile("tap.csv", b"1,2")
    for path, name in zip(two.paths, ("tap_8", "tap_7"), strict=True):
        about = Circumstances("m", datetime(2026, 3, 1, tzinfo=UTC))
        MachineFolder(path).commit(TapTest(name, about, FRF, source=source))
    two.sync(0, 0)
    assert any("tap_8" in text for text in rebuild_files(two.paths[0]))
    taps = {tap.id: bool(tap.excluded) for tap in MachineFolder(two.paths[0]).taps()}
    assert (taps["tap_7"], taps["tap_8"]) == (False, True)
    assert rebuild_files(two.paths[0]) == []


def test_other_settings_are_named_with_both_values_until_a_person_decides(two: TwoCopies) -> None:
    a, toml = MachineFolder(two.paths[0]), two.paths[0] / "machine.toml"
    text = toml.read_text("utf-8")
    other = text.replace("\nspeed_rpm = 12600", "\nspeed_rpm = 12750", 1)
    (a.path / "machine (1).toml").write_text(other, "utf-8")
    (remark,) = a.contents().remarks
    assert (remark.code, remark.about) == ("sync-conflict", "machine (1).toml")
    assert "speed_rpm 12600 (there 12750)" in remark.text
    rebuild_files(a.path)
    assert toml.read_text("utf-8") == text
    assert codes(a.path) == ["sync-contradiction"]
    assert rebuild_files(a.path) == []
    toml.write_text(other, "utf-8")
    assert codes(a.path) == []
    toml.write_text(text, "utf-8")
    (a.path / "sync-conflicts" / "machine (1).toml").unlink()
    assert codes(a.path) == []


def test_tap_files_under_other_names_are_named_and_moved(two: TwoCopies) -> None:
    taps = two.paths[0] / "taps"
    path = min(taps.iterdir())
    content = path.read_bytes()
    for name in (1, 3):
        (taps / CONFLICT_NAMES[name](path)).write_bytes(content)
    assert sorted(codes(two.paths[0])) == ["sync-conflict"] * 2
    assert [remark.code for remark in verify(two.paths[0]).damage] == ["sync-conflict"] * 2
    path.unlink()
    rebuild_files(two.paths[0])
    assert path.read_bytes() == content
    assert codes(two.paths[0]) == []
    assert len(list((two.paths[0] / "damaged").iterdir())) == 1


def test_files_of_a_person_and_of_another_machine_are_no_conflict(two: TwoCopies, tmp_path: Path) -> None:
    other = TwoCopies(tmp_path / "other")
    folder = two.paths[0]
    (folder / "photo.jpg").write_bytes(bytes(range(256)) * 500)
    (folder / "notes.txt").write_text("[machine] of the week\n", "utf-8")
    (folder / "settings of another one.toml").write_text('[machine]\nname = "mill-9"\n', "utf-8")
    assert codes(folder) == []
    assert other.paths[0].is_dir()


def test_a_line_of_a_newer_version_keeps_a_journal_from_being_joined(
    two: TwoCopies, monkeypatch: pytest.MonkeyPatch
) -> None:
    a, b = map(MachineFolder, two.paths)
    with monkeypatch.context() as patch:
        patch.setattr("lobewatch.machine.journal.journal.JOURNAL_FORMAT", 99)
        b.journal.append({"kind": "polish"})
    add_event(a, "greased")
    two.sync(0, 0)
    before = read_files(a.path)
    assert len(rebuild_files(a.path)) == 2
    assert read_files(a.path) == before
    assert set(codes(a.path)) == {"sync-conflict"}


def test_a_file_under_another_name_is_read_once_and_own_files_are_not_searched(
    two: TwoCopies, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, opened = two.paths[0], list[str]()
    (folder / "photo.jpg").write_bytes(bytes(100_000))
    real = os.open

    def counted(path: Any, *arguments: Any, **options: Any) -> int:
        opened.append(Path(path).name)
        return real(path, *arguments, **options)

    with monkeypatch.context() as patch:
        patch.setattr(os, "open", counted)
        MachineFolder(folder).contents()
    assert opened.count("photo.jpg") == 1
    assert opened.count(NAMES[0]) == opened.count(NAMES[1]) == 1


def test_the_mark_of_a_folder_changes_with_a_file_of_another_computer(two: TwoCopies) -> None:
    folder = MachineFolder(two.paths[0])
    before = folder.change_mark
    (folder.path / "report.html").touch()
    (folder.path / "journal.jsonl.1.torn").touch()
    assert folder.change_mark == before
    (folder.path / "journal~1.jsonl").touch()
    assert folder.change_mark != before
