"""Lines of newer versions and damaged lines are named, the other lines count, and nothing of them is rewritten."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, get_args, get_type_hints

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
    "tap": "accepted asked asked_live by_hand by_hand.add by_hand.drop by_hand.fix chain "
    "chain.acceleration_range_v chain.acceleration_v_per_m_s2 chain.daq chain.force_range_v "
    "chain.force_v_per_n conditions conditions.drawbar_kn conditions.hours conditions.note "
    "conditions.reclamped conditions.state conditions.stick_out_mm conditions.temperature_c direction "
    "excluded hit_decisions hit_decisions.codes hit_decisions.decision hit_decisions.decision=accept "
    "hit_decisions.decision=reject hit_decisions.decision=undo hit_decisions.hit id is_mass_checked "
    "operator sha256 size source_sha256 tool",
    "cut": "at by by=accelerometer by=display by=ear by=microphone chatter_frequency_hz chatter_frequency_std_hz "
    "coefficients commanded_rpm cut cut.direction cut.direction=down cut.direction=up cut.feed_angle "
    "cut.helix_lag cut.immersion cut.pitch cut.process_damping cut.radial cut.tangential cut.teeth depth "
    "excluded feed feed_per_tooth id parts parts.from_s parts.hz parts.to_s parts.verdict "
    "parts.verdict=cannot tell parts.verdict=chatter parts.verdict=flip parts.verdict=stable power "
    "power.edge_known power.edge_share power.tangential power.watts program reason recording recording.id "
    "recording.sha256 recording.size software speed_rpm tool upload word word=cannot tell word=chatter word=flip "
    "word=stable",
    "mass-check": "chain chain.acceleration_range_v chain.acceleration_v_per_m_s2 chain.daq chain.force_range_v "
    "chain.force_v_per_n date excluded id mass_kg operator passed ratio ratio_std",
    "ack": "about baseline code newest note operator raised_by until",
    "scatter": "alone common series",
    "hit": "codes decision decision=accept decision=reject decision=undo hit tap",
    "modes": "add drop fix tap",
    "accept": "code tap",
    "exclude": "reason tap",
    "include": "tap",
    "lost": "line tap",
    "event": "date id new_baseline text",
    "withdrawal": "withdraws",
    "join": "contradictions contradictions.about contradictions.kept contradictions.other file lines renumbered",
    "note": "text",
}
"""Fields and enumerated values of each kind of line without those of all lines. Raise JOURNAL_FORMAT with a change."""
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


def list_fields(kind: Any) -> Iterator[str]:
    """Yield the fields of a type, those of a table in it as `table.field`, and enumerated values as `field=value`."""
    for name, hint in get_type_hints(kind).items() if hasattr(kind, "__annotations__") else ():
        yield name
        for part in list_parts(hint):
            yield from [f"{name}={part}"] if isinstance(part, str) else (f"{name}.{key}" for key in list_fields(part))


def list_parts(hint: Any) -> Iterator[Any]:
    yield hint
    for part in get_args(hint):
        yield from list_parts(part)


def test_a_new_field_kind_or_value_raises_the_number_of_the_format() -> None:
    frame = {*LineFrame.__struct_fields__}
    listed = {name: {field for one in kind.types for field in list_fields(one)} for name, kind in LINE_KINDS.items()}
    assert all(kind.fields <= listed[name] | frame for name, kind in LINE_KINDS.items())
    assert {name: " ".join(sorted(fields - frame)) for name, fields in listed.items()} == FIELDS_OF_FORMAT_2
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


def test_an_unknown_field_of_a_table_in_a_line_is_named(folder: MachineFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    conditions = {"state": "warm", "weather": "rain"}
    append(folder, folder.taps()[2].line | {"id": "tap_8", "conditions": conditions}, JOURNAL_FORMAT + 1, monkeypatch)
    (fault,) = folder.journal.read().faults
    assert (fault.is_newer, fault.is_used) == (True, True)
    assert "conditions.weather" in fault.text


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
