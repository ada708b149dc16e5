"""Damage to a machine folder: reported or harmless, and repaired by the stated remedy."""

from __future__ import annotations

import errno
import random
import re
import shlex
import shutil
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import msgspec
import numpy as np
import pytest
from typer.testing import CliRunner

from acquisition import Circumstances, Hit, HitFlags, Remark, SourceFile, TapTest, Trigger, write_hit
from lobewatch.cli import app
from lobewatch.machine.daq_rates import StoredDevice
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_updates import add_event, exclude_entry
from lobewatch.machine.rebuild_files import rebuild_files
from lobewatch.machine.row_file import read_rows, write_rows
from lobewatch.machine.verify_files import Verification, verify
from lobewatch.show.terminal.option_names import with_option_names
from lobewatch.tap.spool import write_setup
from lobewatch.tap.tap_in_progress import begin_tap

MakeTap = Callable[..., TapTest]
NAMES = ["tap_0", "tap_1", "tap_2"]


def file(folder: MachineFolder, number: int) -> Path:
    return folder.path / "taps" / f"tap_{number}.h5"


def flipped(content: bytes, at: int, bit: int = 0) -> bytes:
    return content[:at] + bytes([content[at] ^ 1 << bit]) + content[at + 1 :]


def swap(one: Path, other: Path) -> None:
    first, second = one.read_bytes(), other.read_bytes()
    one.write_bytes(second)
    other.write_bytes(first)


def rename(folder: MachineFolder) -> None:
    file(folder, 1).rename(file(folder, 7))


def cut_both(folder: MachineFolder) -> None:
    """Cut the last line off both files."""
    for name in ("journal.jsonl", "journal.copy.jsonl"):
        path = folder.path / name
        path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:-1]))


def remove_journals(folder: MachineFolder) -> None:
    (folder.path / "journal.jsonl").unlink()
    (folder.path / "journal.copy.jsonl").unlink()


DAMAGES: dict[str, tuple[Callable[[MachineFolder], object], str, list[str]]] = {
    "a flipped bit": (lambda m: file(m, 1).write_bytes(flipped(file(m, 1).read_bytes(), 4000)), "tap_1.h5", NAMES[::2]),
    "half a file": (lambda m: file(m, 2).write_bytes(file(m, 2).read_bytes()[:5000]), "tap_2.h5", NAMES[:2]),
    "an empty file": (lambda m: file(m, 0).write_bytes(b""), "tap_0.h5", NAMES[1:]),
    "a missing file": (lambda m: file(m, 0).unlink(), "tap_0.h5", NAMES[1:]),
    "two swapped": (lambda m: swap(file(m, 0), file(m, 2)), "tap_0.h5", NAMES),
    "one renamed": (rename, "tap_7.h5", NAMES),
    "a copy": (lambda m: shutil.copy(file(m, 1), file(m, 7)), "tap_7.h5", NAMES),
    "one over another": (lambda m: shutil.copy(file(m, 1), file(m, 2)), "tap_2.h5", NAMES[:2]),
    "a broken stranger": (lambda m: file(m, 7).write_bytes(b"\x89HDF"), "tap_7.h5", NAMES),
    "no journal": (remove_journals, "journal.jsonl", NAMES),
    "no last line": (cut_both, "tap_2.h5", NAMES),
    "a journal cut short": (lambda m: m.journal.path.write_bytes(m.journal.path.read_bytes()[:-9]), "journal.j", NAMES),
    "an altered copy": (
        lambda m: m.journal.copy_path.write_bytes(b"?" + m.journal.copy_path.read_bytes()),
        "journal.copy",
        NAMES,
    ),
    "no machine.toml": (lambda m: m.toml.unlink(), "machine.toml", NAMES),
    "an altered history": (lambda m: m.history_path.write_bytes(b"no history"), "history.rows", NAMES),
    "an altered daq.json": (lambda m: (m.path / "daq.json").write_text("[{"), "daq.json", NAMES),
}


@pytest.mark.parametrize("what", DAMAGES)
def test_damage_is_named_and_what_is_reported_to_mend_it_does(what: str, folder: MachineFolder) -> None:
    harm, name, left = DAMAGES[what]
    assert verify(folder.path).remarks == ()
    harm(folder)
    found = verify(folder.path)
    assert any(name in remark.about for remark in found.damage), found
    for remark in found.damage:
        commands = re.findall(r"lobewatch (\w+) (\S+)", remark.cure)
        assert commands or remark.about == "daq.json"
        assert all(word == "rebuild" and shlex.split(path) == [str(folder.path)] for word, path in commands)
    rebuild_files(folder.path)
    (folder.path / "history.rows").unlink(missing_ok=True)
    again = verify(folder.path)
    assert again.damage == ()
    assert [entry.id for entry in MachineFolder(folder.path).taps()] == left
    assert rebuild_files(folder.path) == []


def test_a_tap_file_that_cannot_be_read_just_now_stays_where_it_is(
    folder: MachineFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    entry, read = folder.taps()[0], Path.read_bytes

    def failing(path: Path) -> bytes:
        if path.name == Path(entry.file).name:
            raise OSError(errno.EIO, "Input/output error")
        return read(path)

    with monkeypatch.context() as broken:
        broken.setattr(Path, "read_bytes", failing)
        rebuild_files(folder.path)
    assert (folder.path / entry.file).exists()
    assert entry in MachineFolder(folder.path).taps()
    assert verify(folder.path).damage == ()


def test_rebuild_says_which_corrections_no_copy_tells_any_more(folder: MachineFolder) -> None:
    add_event(folder, "belt changed")
    exclude_entry(folder, "tap_1", "wrong tool")
    for name in ("journal.jsonl", "journal.copy.jsonl"):
        lines = (folder.path / name).read_bytes().splitlines(keepends=True)
        (folder.path / name).write_bytes(b"".join([*lines[:3], b"?" + lines[3], *lines[4:]]))
    told = " ".join(rebuild_files(folder.path))
    lost = r"folder_updates\.add_event, exclude_entry, MachineFolder\.accept, folder_updates\.store_cut"
    assert re.search(rf"journal\.jsonl: .*line 4 .*{lost}", told)
    assert "Logbook.decide_hits" in told
    assert MachineFolder(folder.path).contents().events == ()
    assert [entry.excluded for entry in MachineFolder(folder.path).taps()] == ["", "wrong tool", ""]
    remove_journals(folder)
    assert any("exclude_entry" in text and " line " not in text for text in rebuild_files(folder.path))
    assert [entry.id for entry in MachineFolder(folder.path).taps()] == NAMES


def test_one_sound_copy_has_all_corrections(folder: MachineFolder) -> None:
    add_event(folder, "belt changed")
    exclude_entry(folder, "tap_1", "wrong tool")
    folder.journal.path.write_bytes(folder.journal.path.read_bytes()[:100])
    assert not any("exclude_entry" in text for text in rebuild_files(folder.path))
    assert [event.text for event in MachineFolder(folder.path).contents().events] == ["belt changed"]
    assert [entry.excluded for entry in MachineFolder(folder.path).taps()] == ["", "wrong tool", ""]


def copied(folder: MachineFolder, early: list[str], target: Path, write: Callable[[], object]) -> None:
    """Copy the folder with some files from before a write and all others from after it."""
    before = {name: (folder.path / name).read_bytes() for name in early}
    write()
    shutil.copytree(folder.path, target)
    for name, content in before.items():
        (target / name).write_bytes(content)


@pytest.mark.parametrize("early", [["journal.jsonl"], ["journal.copy.jsonl"], ["journal.jsonl", "journal.copy.jsonl"]])
def test_a_folder_copied_while_a_test_is_saved_is_named_and_mended(
    early: list[str], folder: MachineFolder, make_tap: MakeTap, tmp_path: Path
) -> None:
    copied(folder, early, tmp_path / "copy", lambda: folder.commit(replace(make_tap(3), id="tap_3")))
    rebuild_files(tmp_path / "copy")
    assert verify(tmp_path / "copy").damage == ()
    assert [entry.id for entry in MachineFolder(tmp_path / "copy").taps()] == [*NAMES, "tap_3"]


def test_a_lost_tap_put_back_from_a_backup_counts_again(folder: MachineFolder) -> None:
    content = file(folder, 1).read_bytes()
    file(folder, 1).unlink()
    rebuild_files(folder.path)
    assert [remark.code for remark in verify(folder.path).remarks] == ["tap-lost"]
    file(folder, 1).write_bytes(content)
    assert verify(folder.path).remarks == ()
    assert [entry.id for entry in MachineFolder(folder.path).taps()] == NAMES


@pytest.mark.parametrize("source", [None, SourceFile("a.csv", b"abc")])
def test_a_tap_that_an_ended_program_has_not_entered_is_entered(
    source: SourceFile | None, folder: MachineFolder, make_tap: MakeTap
) -> None:
    tap = replace(make_tap(3, source), id="tap_3")
    folder.commit(tap)
    cut_both(folder)
    if source is None:
        (folder.spool / "tap_3").mkdir(parents=True)
    found = verify(folder.path)
    assert (found.damage, found.entered) == ((), ("taps/tap_3.h5",))
    assert [entry.id for entry in MachineFolder(folder.path).taps()] == [*NAMES, "tap_3"]
    assert verify(folder.path).entered == ()


def test_an_edited_machine_file_is_reported_with_its_first_line(folder: MachineFolder) -> None:
    text = folder.toml.read_text("utf-8")
    folder.toml.write_text(f"# edited\n{text}", "utf-8")
    (folder.path / "report.html").write_text("mine")
    found = verify(folder.path)
    assert found.damage == ()
    assert [remark.code for remark in found.remarks] == ["machine-file-edited", "not-verified"]
    assert "# edited" in found.remarks[0].text


def test_the_commands_say_it(folder: MachineFolder) -> None:
    said = CliRunner().invoke(app, ["verify", str(folder.path)])
    assert (said.exit_code, said.stdout[:2], said.stdout.count("\n")) == (0, "3 ", 1)
    file(folder, 1).write_bytes(b"")
    said = CliRunner().invoke(app, ["verify", str(folder.path)])
    assert said.exit_code == 1
    assert re.search(r"damaged: taps/tap_1\.h5: .*\b0 bytes", said.stdout)
    assert re.search(r"^2 .* 1 damaged$", said.stdout, re.MULTILINE)


def newest_rows(path: Path) -> dict[int, bytes]:
    """Return the bytes of each row by its number; later rows replace earlier ones."""
    return {msgspec.msgpack.decode(row)[0]: row for row in read_rows(path / "history.rows").rows[1:]}


def test_the_history_is_rebuilt_with_equal_arrays(tmp_path: Path, shop: object) -> None:
    shop.run(("A", 12900, 1.0))  # type: ignore[attr-defined]
    for days in (0, 30):
        shop.tap_both(days)  # type: ignore[attr-defined]
        shop.logbook.status()  # type: ignore[attr-defined]
    path: Path = shop.path  # type: ignore[attr-defined]
    logbook = shop.logbook  # type: ignore[attr-defined]
    for tap in logbook.taps:
        logbook.stored_verdicts(tap.id)
    before = newest_rows(path)
    said = CliRunner().invoke(app, ["rebuild", str(path)], catch_exceptions=False)
    assert re.search(r"^history\.rows: .*\b4\b.*\n\Z", said.stdout, re.MULTILINE)
    assert newest_rows(path) == before
    assert len(before) == 4


def test_a_history_that_could_not_be_stored_is_not_reported_to_be_made(
    folder: MachineFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device", "m/history.rows")

    monkeypatch.setattr("lobewatch.history.history_cache.write_rows", full)
    said = CliRunner().invoke(app, ["rebuild", str(folder.path)], catch_exceptions=False)
    assert "m/history.rows: No space left on device" in said.output
    assert re.search(r"^history\.rows: \D*\n\Z", said.stdout, re.MULTILINE)


def damaged_somewhere(folder: MachineFolder, chance: random.Random) -> str:
    """One flipped bit or one cut in one file; its name."""
    files = sorted(path for path in folder.path.rglob("*") if path.is_file() and path.name != ".lock")
    path = chance.choice(files)
    content = path.read_bytes()
    at = chance.randrange(len(content))
    cut = chance.random() < 0.3
    path.write_bytes(content[:at] if cut else flipped(content, at, chance.randrange(8)))
    return path.name


def moved_somewhere(folder: MachineFolder, chance: random.Random) -> str:
    """Delete, swap or duplicate one file; return the affected name."""
    files = sorted(path for path in folder.path.rglob("*") if path.is_file() and path.name != ".lock")
    path = chance.choice(files)
    how = chance.choice(("delete", "swap", "duplicate"))
    if how == "delete":
        path.unlink()
    elif how == "swap":
        swap(path, chance.choice([other for other in files if other.parent == path.parent]))
    else:
        path = Path(shutil.copy(path, path.with_stem(f"{path.stem}_{chance.randrange(10)}")))
    return path.name


def mend(folder: Path, remark: Remark) -> None:
    """Follow the advice that a person reads."""
    cure = with_option_names(remark.cure)
    if remark.about == "machine.toml" and (folder / "machine.toml").exists():
        (folder / "machine.toml").rename(folder / "machine.toml.old")
    if remark.about == "daq.json":
        (folder / remark.about).unlink()
    elif "lobewatch rebuild" in cure:
        rebuild_files(folder)
        (folder / "history.rows").unlink(missing_ok=True)
    elif "lobewatch tap" in cure:
        tap = begin_tap(MachineFolder(folder), Circumstances("m", datetime.now(UTC), "reference"))
        assert tap.hits == []
        old = re.findall(r"Delete (\S+) if", cure)
        shutil.rmtree(*old)


def is_harmless(folder: MachineFolder, results: list[bytes]) -> bool:
    return results_of(folder) == results


def test_spool_files_are_named(full: Path) -> None:
    assert verify(full).remarks == ()
    (full / "spool" / "tap_9" / "0000.h5").unlink()
    (full / "spool" / "tap_9" / "setup.json").write_text("{")
    assert [one.about for one in verify(full).damage] == ["spool/tap_9/0000.h5", "spool/tap_9/setup.json"]


def test_the_rest_of_the_spool_of_a_saved_test_is_no_damage(full: Path) -> None:
    (full / "spool" / "tap_9").rename(full / "spool" / "tap_1")
    (full / "spool" / "tap_1" / "0000.h5").unlink()
    assert verify(full).remarks == ()


def results_of(folder: MachineFolder) -> list[bytes]:
    """Return the content of all files behind results."""
    found = MachineFolder(folder.path)
    taps = found.taps()
    return [*(found.read(entry).required_frf.receptance.tobytes() for entry in taps), found.toml.read_bytes()]


def one_round(
    pristine: Path, work: Path, seed: int, harm: Callable[[MachineFolder, random.Random], str] = damaged_somewhere
) -> str:
    """Damage a copy and repair it as advised; return "named", "harmless", or the failure."""
    shutil.rmtree(work, ignore_errors=True)
    shutil.copytree(pristine, work)
    folder = MachineFolder(work)
    results = results_of(folder)
    name = harm(folder, random.Random(seed))
    found: Verification = verify(work)
    if any(name in remark.about for remark in found.remarks):
        for remark in found.damage:
            if remark.about in {one.about for one in verify(work).damage}:
                mend(work, remark)
        left = verify(work).damage
        return f"not mended: {name}, seed {seed}: {left}" if left else "named"
    return "harmless" if is_harmless(folder, results) else f"silent: {name}, seed {seed}"


@pytest.fixture
def full(folder: MachineFolder, make_tap: MakeTap) -> Path:
    """Return a folder with every kind of file."""
    device = StoredDevice("a", "1", 25600.0, 25600.1, 0.01, 100, 5.0, "2026-01-15T09:00:00+00:00")
    device = msgspec.structs.replace(device, crc=device.computed_crc)
    (folder.path / "daq.json").write_bytes(msgspec.json.format(msgspec.json.encode([device]), indent=2))
    write_rows(folder.history_path, [b"head", b"first", b"second"])
    spool = folder.spool / "tap_9"
    spool.mkdir(parents=True)
    write_setup(spool, Trigger(20.0, 1000, 100))
    pulse = np.exp(-((np.arange(1000) / 30 - 5) ** 2))
    for number in range(2):
        hit = Hit(500 * pulse, 100 * pulse, 25600.0)
        write_hit(spool / f"000{number}.h5", hit, make_tap().circumstances, HitFlags.OK)
    return folder.path


def test_flips_and_cuts_are_named_or_harmless(full: Path, tmp_path: Path) -> None:
    found = [one_round(full, tmp_path / "work", seed) for seed in range(30)]
    assert set(found) <= {"named", "harmless"}
    assert found.count("named") >= 27


def test_deletions_swaps_and_copies_are_named_or_harmless(full: Path, tmp_path: Path) -> None:
    found = [one_round(full, tmp_path / "work", seed, moved_somewhere) for seed in range(12)]
    assert set(found) <= {"named", "harmless"}


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_three_hundred_deletions_swaps_and_copies_are_named_or_harmless(full: Path, tmp_path: Path) -> None:
    found = [one_round(full, tmp_path / "work", seed, moved_somewhere) for seed in range(300)]
    assert set(found) <= {"named", "harmless"}
    assert found.count("named") >= 150


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_two_thousand_flips_and_cuts_are_named_or_harmless(full: Path, tmp_path: Path) -> None:
    found = [one_round(full, tmp_path / "work", seed) for seed in range(2000)]
    assert set(found) <= {"named", "harmless"}
    assert found.count("named") >= 1900
