"""Two copies of a machine folder under a sync program that keeps one side of a file and puts the other next to it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from acquisition import Channel, Circumstances, Frf, HitDecision, TapTest, new_tap_id
from acquisition.files.cut_file import CutSignal
from lobewatch.machine import folder_updates as updates
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.machine.journal.alarm_entries import Acknowledgement
from lobewatch.machine.journal.join_lines import compute_fact_mark, find_open_contradictions, find_subject
from lobewatch.machine.journal.mass_checks import MassCheckEntry, SensorChain
from lobewatch.machine.rebuild_files import rebuild_files
from lobewatch.machine.settings.requested_cut import find_cut_setting
from lobewatch.machine.verify_files import verify
from modal import ModeEdits

START = datetime(2026, 1, 15, 9, tzinfo=UTC)
CONFLICT_NAMES: tuple[Callable[[Path], str], ...] = (
    lambda path: f"{path.stem} (Konflikt-Kopie von PC-B 2026-11-27){path.suffix}",
    lambda path: f"{path.stem} (1){path.suffix}",
    lambda path: f"{path.stem}.sync-conflict-20261127-101112-ABCDEFG{path.suffix}",
    lambda path: f"{path.name}~",
    lambda path: f"{path.stem}-PC-B{path.suffix}",
    lambda path: f"冲突的副本 {path.name}",
    lambda path: f".{path.name}.tmp",
)
"""Names that sync programs give the other side of a file."""
UNSYNCED = (".lock", ".lock.holder", "history.rows", "standing.json")
CHAIN = SensorChain("DAQ 1", 2.25e-3, 1e-2, 5.0, 5.0)
SIGNAL = CutSignal(np.arange(3000.0), 51200.0, np.arange(3000, dtype=np.int32), Channel("acceleration", 1.0, 5.0))
FRF = Frf(np.arange(1.0, 50.0), np.linspace(1 + 1j, 49 + 49j, 49).astype(np.complex128))
Entry = dict[str, Any]


@dataclass(frozen=True)
class Fact:
    """Entry that was announced to a person."""

    mark: str
    """Mark of its line."""
    entry: Entry
    """Its line."""
    target: str
    """Mark of the line that its subject comes from, with the rest of the subject; empty without a subject."""
    known: frozenset[str]
    """Marks of the lines in the journal that it was written to."""


class TwoCopies:
    """Two computers with one synced machine folder."""

    def __init__(self, root: Path) -> None:
        """Make the folder with three tap tests, one of them excluded, on both computers."""
        self.paths = root / "a" / "m", root / "b" / "m"
        self.facts: list[Fact] = []
        """Announced facts."""
        self.programs: list[str] = []
        """Names of saved programs."""
        self.texts: list[str] = []
        """Texts that a person has read."""
        self._base: dict[str, bytes] = {}
        self._count, self._n_taps = 0, 3
        for path in self.paths:
            shutil.copytree(_make_first_folder().name, path)
        self.sync(0, 0)

    def write(self, side: int, action: str, number: int) -> None:
        """Let a person do something on one computer; refusals change nothing."""
        folder = MachineFolder(self.paths[side])
        before = folder.journal.read().lines
        self._count += 1
        try:
            getattr(self, f"_{action}")(folder, number)
        except ValueError:
            return
        lines = MachineFolder(self.paths[side]).journal.read().lines
        entries = [json.loads(line) for line in lines]
        known = frozenset(map(compute_fact_mark, entries))
        for entry in entries[len(before) :]:
            self.facts.append(Fact(compute_fact_mark(entry), entry, _find_target(entry, entries), known))

    def sync(self, kept: int, name: int) -> None:
        """Let the sync program keep the files of one side, and put those of the other next to them."""
        sides = [read_files(path) for path in self.paths]
        result: dict[str, bytes] = {}
        for file in sorted({*sides[0], *sides[1]}):
            contents = [side.get(file) for side in sides]
            changed = [content for content in contents if content != self._base.get(file)]
            if len({*contents}) == 2 and len(changed) == 2 and None not in contents:
                path = Path(file)
                beside = path.with_name(CONFLICT_NAMES[name](path))
                while str(beside) in {**sides[0], **sides[1], **result}:
                    beside = beside.with_name(f"{beside.stem} 2{beside.suffix}")
                result[file], result[str(beside)] = contents[kept], contents[1 - kept]  # type: ignore[assignment]
            else:
                content = changed[0] if changed else contents[0]
                result |= {} if content is None else {file: content}
        for path in self.paths:
            _write_files(path, result)
        self._base = result

    def rebuild(self, side: int) -> None:
        """Rebuild on one computer; a person reads the report and the remarks."""
        self.texts += rebuild_files(self.paths[side])
        self.texts += map(str, MachineFolder(self.paths[side]).contents().remarks)

    def find_lost(self, side: int) -> list[str]:
        """Return the facts that neither count nor are named on one computer."""
        folder, said = MachineFolder(self.paths[side]), " ".join(self.texts)
        contents, entries = folder.contents(), folder.journal.read().entries
        present = {compute_fact_mark(entry): entry for entry in entries}
        lost = [f"missing: {fact.entry}" for fact in self.facts if fact.mark not in present]
        lost += [f"program {name}" for name in self.programs if name not in folder.toml_text and name not in said]
        last = {find_subject(entry): entry for entry in entries if find_subject(entry)}
        newest = {_find_target(entry, entries): compute_fact_mark(entry) for entry in last.values()}
        for fact in self.facts:
            newer = [
                other for other in self.facts if other.target == fact.target and fact.mark in other.known - {other.mark}
            ]
            if fact.target and not newer and newest[fact.target] != fact.mark:
                is_same = _value_of(present[newest[fact.target]]) == _value_of(fact.entry)
                lost += [] if is_same or _words_of(fact.entry) in said else [f"does not count: {fact.entry}"]
        for one in find_open_contradictions(folder.journal.read().other_entries):
            is_kept = _value_of(last[find_subject(one.kept)]) == _value_of(one.kept)
            lost += [] if is_kept and one.kept["time"] >= one.other["time"] else [f"said to be kept: {one}"]
        withdrawn = {entry["withdraws"] for entry in entries if "withdraws" in entry}
        noted = {entry["id"] for entry in entries if entry["kind"] == "event" and "id" in entry}
        lost += [] if {event.id for event in contents.events} == noted - withdrawn else ["events"]
        ids = [entry["id"] for entry in entries if "id" in entry]
        lost += [f"identity {name} twice" for name in {*ids} if ids.count(name) > 1]
        n_taps = len(contents.taps) + len(contents.lost)
        return lost + [f"{n_taps} tap tests"] * (n_taps != self._n_taps) + [str(one) for one in contents.lost]

    def _tap(self, folder: MachineFolder, number: int) -> None:
        about = Circumstances("m", START + timedelta(days=self._n_taps), operator=f"no {self._count}")
        name = f"tap_{len([*folder.path.glob('taps/*.h5')])}" if number % 2 else new_tap_id(about)
        folder.commit(replace(TapTest(new_tap_id(about), about, FRF), id=name))
        self._n_taps += 1

    def _event(self, folder: MachineFolder, number: int) -> None:
        updates.add_event(folder, f"work {self._count}", new_baseline=not number % 5)

    def _withdraw(self, folder: MachineFolder, number: int) -> None:
        updates.withdraw_event(folder, _choose(folder, "event", number))

    def _exclude(self, folder: MachineFolder, number: int) -> None:
        kind = ("tap", "cut", "mass-check")[number % 3]
        updates.exclude_entry(folder, _choose(folder, kind, number // 3), f"reason {self._count}")

    def _include(self, folder: MachineFolder, number: int) -> None:
        updates.include_entry(folder, _choose(folder, ("tap", "cut", "mass-check")[number % 3], number // 3))

    def _accept(self, folder: MachineFolder, number: int) -> None:
        folder.accept(_choose(folder, "tap", number), f"code-{self._count}")

    def _modes(self, folder: MachineFolder, number: int) -> None:
        updates.store_mode_edits(folder, [_choose(folder, "tap", number % 2)], ModeEdits(add=(1000.0 + self._count,)))

    def _hit(self, folder: MachineFolder, number: int) -> None:
        decision = HitDecision(1 + number % 2, "reject" if number % 4 < 2 else "undo")
        updates.store_hit_decisions(folder, _choose(folder, "tap", number % 2), [decision])

    def _cut(self, folder: MachineFolder, number: int) -> None:
        program = folder.machine.program[0].name
        setting = find_cut_setting(folder.machine, program, 9000.0 + self._count, 1.0)
        cut = updates.make_observed_cut(setting, "chatter")
        updates.store_cut(folder, cut, replace(SIGNAL, lost_scans=self._count) if number % 2 else None)

    def _mass(self, folder: MachineFolder, number: int) -> None:
        check = MassCheckEntry("", datetime.now(UTC), 1.2, 1 + self._count / 1000, 1e-3, bool(number % 2), CHAIN)
        updates.store_mass_check(folder, check)

    def _ack(self, folder: MachineFolder, number: int) -> None:
        now, tap = datetime.now(UTC), _choose(folder, "tap", number % 2)
        said = Acknowledgement("decay", "x", tap, now, None, now, note=f"note {self._count}")
        with folder.locked():
            folder.journal.append(said.line)

    def _program(self, folder: MachineFolder, _: int) -> None:
        name, first = f"P{self._count}", folder.machine.program[0]
        updates.save_program(
            folder, type(first)(**{key: getattr(first, key) for key in first.__struct_fields__} | {"name": name})
        )
        self.programs.append(name)


@cache
def _make_first_folder() -> TemporaryDirectory[str]:
    """Make a machine folder with three tap tests, one of them excluded."""
    place = TemporaryDirectory()
    make_machine_folder(Path(place.name), "surrogate_machine.toml")
    folder = MachineFolder(place.name)
    for day in range(3):
        about = Circumstances("m", START + timedelta(days=day))
        folder.commit(TapTest(f"tap_{day}", about, FRF))
    updates.exclude_entry(folder, "tap_1", "first reason")
    return place


def _choose(folder: MachineFolder, kind: str, number: int) -> str:
    entries = folder.journal.read().entries
    names = [entry["id"] for entry in entries if entry["kind"] == kind and "id" in entry]
    if not names:
        raise ValueError("nothing to choose")
    return str(names[number % len(names)])


def _find_target(entry: Entry, entries: list[Entry]) -> str:
    """Return the subject of an entry with the mark of the line that made it, as identities may change."""
    name = entry.get("tap") or entry.get("raised_by")
    made = next((compute_fact_mark(line) for line in entries if line.get("id") == name), str(name))
    return find_subject(entry).replace(json.dumps(name), made) if find_subject(entry) else ""


def _value_of(entry: Entry) -> Entry:
    return {key: entry[key] for key in ("kind", "reason", "add", "decision", "note") if key in entry}


def _words_of(entry: Entry) -> str:
    """Return the words that name an entry of its kind."""
    words = {"exclude": f"{entry.get('reason')}", "include": "included", "modes": f"{entry.get('add')}"}
    return words.get(entry["kind"]) or str(entry.get("note") or f"hit {entry.get('hit')} {entry.get('decision')}")


def read_files(path: Path) -> Mapping[str, bytes]:
    """Return the synced files of a folder by path."""
    files = [file for file in path.rglob("*") if file.is_file() and file.name not in UNSYNCED] if path.exists() else []
    return {file.relative_to(path).as_posix(): file.read_bytes() for file in files}


def _write_files(path: Path, files: Mapping[str, bytes]) -> None:
    for file in read_files(path).keys() - files.keys():
        (path / file).unlink()
    for file, content in files.items():
        target = path / file
        if not target.exists() or target.read_bytes() != content:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(content)


def find_remaining_problems(path: Path) -> list[str]:
    """Return the findings of verify, except for contradictions that wait for a person."""
    return [str(remark) for remark in verify(path).damage if remark.code != "sync-contradiction"]
