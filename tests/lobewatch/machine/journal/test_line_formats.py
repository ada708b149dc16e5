"""Lines of newer versions and damaged lines are named, the other lines count, and nothing of them is rewritten."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from acquisition import DataError, TapTest
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.machine.folder_updates import add_event, exclude_entry
from lobewatch.machine.journal.journal import make_entry
from lobewatch.machine.journal.line_formats import FORMAT_KEY, JOURNAL_FORMAT, LINE_KINDS, LineFrame
from lobewatch.machine.rebuild_files import rebuild_files
from lobewatch.machine.verify_files import verify
from lobewatch.monitoring.status_rules import STATUS_BY_CODE, StatusLevel

MakeTap = Callable[..., TapTest]
TAP = "tap_1"
FIELDS_OF_FORMAT_2 = {
    "accept": "code tap",
    "ack": "about baseline code newest note operator raised_by until",
    "cut": "at by chatter_frequency_hz chatter_frequency_std_hz coefficients commanded_rpm cut depth excluded feed "
    "feed_per_tooth id parts power program reason recording software speed_rpm tool word",
    "event": "date id new_baseline text",
    "exclude": "reason tap",
    "hit": "codes decision hit tap",
    "include": "tap",
    "join": "contradictions file lines renumbered",
    "lost": "line tap",
    "mass-check": "chain date excluded id mass_kg operator passed ratio ratio_std",
    "modes": "add drop fix tap",
    "note": "text",
    "scatter": "alone common series",
    "tap": "accepted asked asked_live by_hand chain conditions direction excluded hit_decisions id is_mass_checked "
    "operator sha256 size source_sha256 tool",
    "withdrawal": "withdraws",
}
"""Fields of each kind of line, besides those of all lines. Raise JOURNAL_FORMAT with every change."""
NOT_UNDERSTOOD: list[dict[str, Any]] = [
    {"kind": "polish", "grit": 400},
    {"kind": ["exclude"], "tap": TAP},
    {"kind": "exclude", "tap": [TAP], "reason": "x"},
    {"kind": "exclude", "reason": "x"},
    {"kind": "include", "tap": {"id": TAP}},
    {"kind": "accept", "tap": TAP, "code": 7},
    {"kind": "modes", "tap": TAP, "add": "1000"},
    {"kind": "modes", "tap": TAP, "add": [-5.0]},
    {"kind": "hit", "tap": TAP, "hit": "1", "decision": "reject"},
    {"kind": "hit", "tap": TAP, "hit": 1, "decision": "perhaps"},
    {"kind": "event", "id": "e1", "date": "2026-02-30", "text": "x", "new_baseline": False},
    {"kind": "event", "id": "e1", "date": "2026-02-03T10:00:00", "text": "x", "new_baseline": False},
    {"kind": "event", "withdraws": ["e1"]},
    {"kind": "cut", "id": "c1", "at": "2026-02-03T10:00:00+00:00", "cut": {"teeth": 4, "wave": 2}},
    {"kind": "mass-check", "id": "m1", "date": 7},
    {"kind": "ack", "code": "decay"},
    {"kind": "scatter", "time": "2026-02-03T10:00:00+00:00", "alone": 1.0, "common": [0, 0], "series": 1},
    {"kind": "tap", "id": "tap_9"},
    {"kind": "tap", "id": 9, "sha256": "", "size": 1, "time": "x", "tool": "", "direction": "x", "source_sha256": ""},
    {"kind": "join", "file": "x", "lines": "1"},
    {"kind": "lost", "line": "3"},
    {"kind": "note", "text": "x", "batch": [1]},
    {"kind": "note", "text": float("inf")},
]


def append(folder: MachineFolder, entry: dict[str, Any], written: int, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setattr("lobewatch.machine.journal.journal.JOURNAL_FORMAT", written)
        folder.journal.append(entry)


def codes(folder: MachineFolder) -> list[str]:
    return [remark.code for remark in MachineFolder(folder.path).contents().remarks]


def test_a_new_field_or_kind_raises_the_number_of_the_format() -> None:
    common = {*LineFrame.__struct_fields__}
    fields = {name: " ".join(sorted(kind.fields - common)) for name, kind in LINE_KINDS.items()}
    assert fields == FIELDS_OF_FORMAT_2
    assert JOURNAL_FORMAT == 2


def test_every_new_line_has_the_number_and_lines_without_it_are_of_the_first_format(folder: MachineFolder) -> None:
    add_event(folder, "greased")
    assert [entry[FORMAT_KEY] for entry in folder.journal.read().entries] == [JOURNAL_FORMAT] * 4


@pytest.fixture
def plain(tmp_path: Path) -> MachineFolder:
    """Return a machine folder without tap tests."""
    return MachineFolder(make_machine_folder(tmp_path / "plain", "new_machine.toml").parent)


@pytest.mark.parametrize("entry", NOT_UNDERSTOOD, ids=lambda entry: str(entry)[:50])
def test_a_line_that_is_not_understood_is_named_and_the_others_count(
    plain: MachineFolder, entry: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    append(plain, entry, JOURNAL_FORMAT, monkeypatch)
    append(plain, {**entry, "time": "2026-02-03T10:00:00+00:00"}, JOURNAL_FORMAT + 1, monkeypatch)
    add_event(plain, "greased")
    contents = MachineFolder(plain.path).contents()
    assert [remark.code for remark in contents.remarks] == ["line-damaged", "journal-newer"]
    assert [remark.about for remark in contents.remarks] == ["journal.jsonl"] * 2
    assert all(f"line {number} " in str(remark) for number, remark in enumerate(contents.remarks, 1))
    assert [event.text for event in contents.events] == ["greased"]
    assert {STATUS_BY_CODE[remark.code] for remark in contents.remarks} == {StatusLevel.WARN}
    assert {remark.code for remark in verify(plain.path).damage} == {"line-damaged", "journal-newer"}


def test_a_damaged_line_among_many_of_tap_tests_leaves_out_only_itself(
    folder: MachineFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    append(folder, {**folder.taps()[2].line, "id": "tap_9", "size": "1"}, JOURNAL_FORMAT, monkeypatch)
    exclude_entry(folder, TAP, "wrong tool")
    assert [tap.excluded for tap in folder.taps()] == ["", "wrong tool", ""]
    assert codes(folder) == ["line-damaged"]


def test_a_known_line_with_an_unknown_field_counts_and_is_named(
    folder: MachineFolder, make_tap: MakeTap, monkeypatch: pytest.MonkeyPatch
) -> None:
    append(folder, make_entry("exclude", tap=TAP, reason="x", until="tomorrow"), JOURNAL_FORMAT + 1, monkeypatch)
    line = folder.taps()[2].line | {"id": "tap_8", "weather": "rain"}
    append(folder, line, JOURNAL_FORMAT + 1, monkeypatch)
    contents = MachineFolder(folder.path).contents()
    assert [tap.excluded for tap in contents.taps] == ["", "x", ""]
    assert [tap.id for tap in contents.lost] == ["tap_8"]
    assert codes(folder).count("journal-newer") == 2


def test_a_line_of_a_newer_version_that_is_understood_needs_no_remark(
    folder: MachineFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    append(folder, make_entry("exclude", tap=TAP, reason="x"), JOURNAL_FORMAT + 1, monkeypatch)
    assert codes(folder) == []
    assert [tap.excluded for tap in folder.taps()] == ["", "x", ""]


def test_rebuild_rewrites_no_line_of_a_newer_version(folder: MachineFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    append(folder, make_entry("polish", grit=400), JOURNAL_FORMAT + 1, monkeypatch)
    before = folder.journal.path.read_bytes()
    rebuild_files(folder.path)
    assert folder.journal.path.read_bytes() == before
    add_event(folder, "greased")
    rebuild_files(folder.path)
    assert folder.journal.path.read_bytes().startswith(before)
    folder.journal.path.write_bytes(damaged := before.replace(b'"tap_1"', b'"tap_X"', 1))
    with pytest.raises(DataError, match=r"line 4 .*newer version .*Update lobewatch"):
        rebuild_files(folder.path)
    assert folder.journal.path.read_bytes() == damaged


def test_a_damaged_line_is_given_up_by_rebuild_and_stays_in_the_journal(
    folder: MachineFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    append(folder, {"kind": "exclude", "tap": [TAP], "reason": "x"}, JOURNAL_FORMAT, monkeypatch)
    before = folder.journal.path.read_bytes()
    (report,) = rebuild_files(folder.path)
    assert "line 4 " in report
    assert codes(folder) == ["line-lost"]
    assert verify(folder.path).damage == ()
    assert folder.journal.path.read_bytes().startswith(before)
    assert rebuild_files(folder.path) == []


def test_many_lines_are_named_in_few_remarks(plain: MachineFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    for _ in range(30):
        append(plain, {"kind": "polish"}, JOURNAL_FORMAT + 1, monkeypatch)
    remarks = MachineFolder(plain.path).contents().remarks
    assert len(remarks) == 21
    assert remarks[-1].text.startswith("10 ")


def test_a_line_with_a_number_of_a_wrong_type_is_named(plain: MachineFolder) -> None:
    plain.journal.append({"kind": "note", "text": "x", "joined": 3})
    assert codes(plain) == ["line-damaged"]
    assert json.loads(plain.journal.path.read_bytes().splitlines()[-1])["joined"] == 3
