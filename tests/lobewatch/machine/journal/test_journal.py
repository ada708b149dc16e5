"""The journal: nothing of it is lost unsaid, wherever it is cut or altered, and nothing is cut off without a copy."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from acquisition import DataError, TapTest, new_tap_id
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.machine.folder_updates import add_event
from lobewatch.machine.journal.journal import JournalFileState, scan_journal_file
from lobewatch.machine.rebuild_files import rebuild_files
from lobewatch.machine.verify_files import verify

MakeTap = Callable[..., TapTest]
NAMES = ("journal.jsonl", "journal.copy.jsonl")


def as_it_is(folder: MachineFolder) -> MachineFolder:
    return MachineFolder(folder.path)


def told(folder: MachineFolder) -> str:
    return " ".join(map(str, as_it_is(folder).contents().remarks))


def ids(folder: MachineFolder) -> list[str]:
    return [entry.id for entry in as_it_is(folder).taps()]


def line_ends(path: Path) -> list[int]:
    return [i for i, byte in enumerate(path.read_bytes()) if byte == ord("\n")]


@pytest.mark.parametrize("name", NAMES)
def test_a_cut_anywhere_is_named_or_harmless_and_no_tap_is_lost(name: str, folder: MachineFolder) -> None:
    path = folder.path / name
    whole, ends = path.read_bytes(), line_ends(path)
    last_line = set(range(ends[1] + 1, len(whole))) if name == NAMES[1] else set[int]()  # as a crash does
    for cut in {*range(0, len(whole), 97), *ends, *(end + 1 for end in ends[:-1])}:
        path.write_bytes(whole[:cut])
        assert ids(folder) == ["tap_0", "tap_1", "tap_2"], cut
        assert (f"{name}: " in told(folder)) or cut in {*last_line, ends[1], ends[1] + 1}, cut
        assert f"{name}: " in told(folder) or name == NAMES[1]


@pytest.mark.parametrize("name", NAMES)
def test_a_flipped_bit_anywhere_is_named_and_no_tap_is_lost(name: str, folder: MachineFolder) -> None:
    path = folder.path / name
    whole = path.read_bytes()
    for at in {*range(0, len(whole), 61), *line_ends(path)}:
        for bit in (0, 3, 6):
            path.write_bytes(whole[:at] + bytes([whole[at] ^ 1 << bit]) + whole[at + 1 :])
            assert ids(folder) == ["tap_0", "tap_1", "tap_2"], (at, bit)
            assert f"{name}: " in told(folder), (at, bit)


def test_nothing_is_written_to_a_damaged_journal_and_nothing_of_it_changed(
    folder: MachineFolder, make_tap: MakeTap
) -> None:
    path = folder.path / "journal.jsonl"
    content = path.read_bytes()[:-1] + b"\x0b"
    path.write_bytes(content)
    with pytest.raises(DataError, match=r"journal\.jsonl: .*line 3 .*lobewatch rebuild"):
        as_it_is(folder).commit(make_tap(3))
    assert path.read_bytes() == content
    assert not (folder.path / "taps" / "tap_3.h5").exists()


def test_tap_files_without_any_journal_are_read_and_no_baseline_is_begun(
    folder: MachineFolder, make_tap: MakeTap
) -> None:
    for name in NAMES:
        (folder.path / name).unlink()
    assert ids(folder) == ["tap_0", "tap_1", "tap_2"]
    assert re.search(r"^journal\.jsonl: missing .* 3 tap files", told(folder))
    with pytest.raises(DataError, match=r"journal\.jsonl: missing .* 3 tap files"):
        as_it_is(folder).commit(make_tap(3))


def test_a_line_torn_by_a_crash_counts_for_nothing_does_not_block_and_is_kept(
    folder: MachineFolder, make_tap: MakeTap
) -> None:
    path, copy = (folder.path / name for name in NAMES)
    whole, begin = path.read_bytes(), line_ends(path)[1] + 1
    for cut in range(begin + 1, len(whole) - 2, 40):
        path.write_bytes(whole[:cut])
        copy.write_bytes(whole[:begin])
        (folder.path / "taps" / "tap_2.h5").unlink()
        assert ids(folder) == ["tap_0", "tap_1"]
        assert told(folder) == ""
        as_it_is(folder).commit(make_tap(2))
        assert ids(folder) == ["tap_0", "tap_1", "tap_2"]
        assert path.read_bytes() == copy.read_bytes()
    kept = sorted(folder.path.glob("journal.jsonl.*.torn"))
    assert kept[0].read_bytes() == whole[begin : begin + 1]
    assert len(kept) == len(range(begin + 1, len(whole) - 2, 40))


def test_a_copy_that_a_crash_left_behind_is_brought_up(folder: MachineFolder, make_tap: MakeTap) -> None:
    path, copy = (folder.path / name for name in NAMES)
    copy.write_bytes(copy.read_bytes()[: line_ends(copy)[1] + 1])
    assert told(folder) == ""
    as_it_is(folder).commit(make_tap(3))
    assert path.read_bytes() == copy.read_bytes()


def test_a_journal_from_before_there_was_a_copy_is_read_and_written(folder: MachineFolder, make_tap: MakeTap) -> None:
    path, copy = (folder.path / name for name in NAMES)
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    path.unlink()
    copy.unlink()
    write_without_numbers(path, lines)
    assert ids(folder) == ["tap_0", "tap_1", "tap_2"]
    assert told(folder) == ""
    as_it_is(folder).commit(make_tap(3))
    assert ids(folder)[-1] == "tap_3"
    assert path.read_bytes() == copy.read_bytes()


def write_without_numbers(path: Path, lines: list[dict[str, object]]) -> None:
    """Write a journal as the first version did."""
    import hashlib
    import zlib

    last = b""
    for line in lines:
        told = {key: value for key, value in line.items() if key not in ("number", "crc")}
        told["previous"] = hashlib.sha256(last).hexdigest() if last else ""
        told["crc"] = zlib.crc32(json.dumps(told, sort_keys=True).encode())
        last = json.dumps(told).encode()
        with path.open("ab") as file:
            file.write(last + b"\n")


@pytest.mark.quick
def test_a_missing_copy_is_named(folder: MachineFolder) -> None:
    (folder.path / NAMES[1]).unlink()
    assert "journal.copy.jsonl: missing" in told(folder)


def test_a_file_of_another_size_or_missing_or_altered_is_left_out_and_named(folder: MachineFolder) -> None:
    path = folder.path / "taps" / "tap_1.h5"
    content = path.read_bytes()
    for damaged, fact in ((content[:-1], f"{len(content)} bytes"), (content[:-1] + b"?", "SHA-256"), (None, "missing")):
        if damaged is None:
            path.unlink()
        else:
            path.write_bytes(damaged)
        assert ids(folder) == ["tap_0", "tap_2"]
        assert "taps/tap_1.h5: " in told(folder)
        assert fact in told(folder)
    path.write_bytes(content)
    assert told(folder) == ""


@pytest.mark.quick
def test_a_file_without_a_line_does_not_count_and_is_named(folder: MachineFolder) -> None:
    (folder.path / "taps" / "copy.h5").write_bytes((folder.path / "taps" / "tap_1.h5").read_bytes())
    assert ids(folder) == ["tap_0", "tap_1", "tap_2"]
    assert "taps/copy.h5: not in the journal" in told(folder)


def test_lines_of_one_write_may_all_be_missing_from_the_copy_but_no_other(folder: MachineFolder) -> None:
    journal, copy = folder.path / NAMES[0], folder.path / NAMES[1]
    before = copy.read_bytes()
    folder.journal.append(*({"kind": "note", "text": str(number)} for number in range(3)))
    assert len(json.loads(f"[{','.join(journal.read_text().splitlines())}]")) == 6
    assert copy.read_bytes() == journal.read_bytes()
    copy.write_bytes(before)
    assert not told(folder)
    copy.write_bytes(before[: line_ends(copy)[1] + 1])
    assert re.search(r"journal\.copy\.jsonl: .*4 lines", told(folder))
    copy.write_bytes(before)
    as_it_is(folder).journal.append({"kind": "note", "text": "brings the copy up"})
    assert copy.read_bytes() == journal.read_bytes()


def test_a_flipped_bit_in_a_long_journal_is_named(folder: MachineFolder) -> None:
    folder.journal.append(*({"kind": "note", "text": "x"} for _ in range(40)))
    path = folder.path / NAMES[0]
    whole = path.read_bytes()
    for at in range(0, len(whole), 397):
        path.write_bytes(whole[:at] + bytes([whole[at] ^ 4]) + whole[at + 1 :])
        assert "journal.jsonl: " in told(folder), at


def test_only_what_was_appended_is_read_again(folder: MachineFolder) -> None:
    path = folder.path / NAMES[0]
    before = scan_journal_file(path, JournalFileState(exists=False))
    assert scan_journal_file(path, before) is before
    folder.journal.append({"kind": "note", "text": "x"})
    after = scan_journal_file(path, before)
    assert (len(after.chain), after.first_broken_line) == (len(before.chain) + 1, 0)
    assert all(old is new for old, new in zip(before.chain, after.chain, strict=False))


def test_a_journal_of_another_machine_is_named_and_mended(tmp_path: Path, make_tap: MakeTap) -> None:
    mine, other = (of_two_taps(tmp_path / name, make_tap) for name in ("mill 3", "mill 7"))
    known = ids(mine)
    for name in NAMES:
        (mine.path / name).write_bytes((other.path / name).read_bytes())
    assert re.search(r"journal\.jsonl: .*another machine.* 2 tap tests of mill-7.* 2 of mill 3", told(mine))
    assert ids(mine) == known
    assert as_it_is(mine).contents().events == ()
    with pytest.raises(DataError, match=r"another machine.*lobewatch rebuild"):
        as_it_is(mine).commit(make_tap(9))
    assert next(one.code for one in verify(mine.path).damage) == "journal-damaged"
    rebuild_files(mine.path)
    assert verify(mine.path).damage == ()
    assert ids(mine) == known


def test_a_renamed_machine_and_lost_taps_are_no_other_machine(tmp_path: Path, make_tap: MakeTap) -> None:
    mine = of_two_taps(tmp_path / "mill 3", make_tap)
    text = mine.toml.read_text("utf-8")
    mine.toml.write_text(text.replace('"mill 3"', '"mill 8"'), "utf-8")
    assert told(mine) == ""
    mine.toml.write_text(text, "utf-8")
    for path in (mine.path / "taps").iterdir():
        path.rename(path.with_name(path.name.replace("reference", "ref")))
    assert "another machine" not in told(mine)


def of_two_taps(path: Path, make_tap: MakeTap) -> MachineFolder:
    """With an event."""
    make_machine_folder(path, "new_machine.toml")
    folder = MachineFolder(path)
    for day in range(2):
        tap = make_tap(day)
        about = replace(tap.circumstances, machine=path.name)
        folder.commit(replace(tap, circumstances=about, id=new_tap_id(about)))
    add_event(folder, "greased")
    return folder
