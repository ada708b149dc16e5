"""The folder of one machine: machine.toml, taps/, journal.jsonl, spool/ and history.h5."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import os
import shutil
import zlib
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from acquisition import DataError, TapTest, read_tap, write_tap
from lobewatch.machine.machine_file import Machine, read_machine
from lobewatch.machine.named_folder import named_folder


class BusyError(DataError):
    """Another program writes to the folder."""


@dataclass(frozen=True)
class TapEntry:
    """One committed tap test, a line of the journal."""

    id: str
    """Name of its file in taps/, without .h5."""
    sha256: str
    """Of that file."""
    time: str
    """When it was taken (ISO 8601)."""
    tool: str
    """What was in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    source_sha256: str
    """Of the recording it was replayed from; empty for a live test."""
    accepted: tuple[str, ...] = ()
    """Questions about it that a person has accepted, by code; lines of their own."""


class MachineFolder:
    """What stands in the folder of one machine, and the one way to add to it."""

    def __init__(self, path: Path | str) -> None:
        """DataError where this is no machine folder."""
        self.path = named_folder(path)
        if not self.toml.is_file():
            raise DataError(
                f"{self.path}: no machine.toml in it; make a machine folder with: lobewatch init {self.path}"
            )

    @property
    def toml(self) -> Path:
        """The machine file."""
        return self.path / "machine.toml"

    @property
    def history(self) -> Path:
        """The history of the stability lobes, a cache."""
        return self.path / "history.h5"

    @property
    def spool(self) -> Path:
        """Where the hits of a test in progress are kept."""
        return self.path / "spool"

    @property
    def _journal(self) -> Path:
        return self.path / "journal.jsonl"

    @cached_property
    def machine(self) -> Machine:
        """The machine file as it was when first asked for."""
        return read_machine(self.toml)

    @property
    def mark(self) -> tuple[int, ...]:
        """Changes with machine.toml and the journal."""
        found = [path.stat() for path in (self.toml, self._journal) if path.exists()]
        return tuple(number for one in found for number in (one.st_mtime_ns, one.st_size, one.st_ino))

    @cached_property
    def _lock(self) -> FileLock:
        return FileLock(self.path / ".lock", timeout=0)

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other programs from writing here, once or several times over; BusyError where one already does."""
        lock = self._lock
        try:
            lock.acquire()
        except Timeout as error:
            raise BusyError(f"{self.path}: another lobewatch is writing here; wait until it is done") from error
        try:
            yield
        finally:
            lock.release()

    def taps(self) -> list[TapEntry]:
        """The committed tap tests, oldest first by their time."""
        names = [field.name for field in fields(TapEntry) if field.name != "accepted"]
        lines, accepted = self._lines(), dict[str, list[str]]()
        for line in lines:
            if line["kind"] == "accept":
                accepted.setdefault(line["tap"], []).append(line["code"])
        taps = [
            TapEntry(**{name: line[name] for name in names}, accepted=tuple(accepted.get(line["id"], ())))
            for line in lines
            if line["kind"] == "tap"
        ]
        return sorted(taps, key=lambda tap: datetime.fromisoformat(tap.time))

    def read(self, entry: TapEntry) -> TapTest:
        """A tap test, its file checked against the journal before HDF5 sees it."""
        path = self._file(entry.id)
        if not path.is_file():
            raise DataError(f"{path}: named in the journal but missing; put it back from a backup")
        if hashlib.sha256(path.read_bytes()).hexdigest() != entry.sha256:
            raise DataError(f"{path}: altered since it was written (SHA-256 differs); put it back from a backup")
        return read_tap(path)

    def commit(self, tap: TapTest) -> None:
        """Write the tap file, then its journal line; saved for good when this returns."""
        path = self._file(tap.id)
        path.parent.mkdir(exist_ok=True)
        content = write_tap(path, tap)
        about = tap.circumstances
        source = hashlib.sha256(tap.source.content).hexdigest() if tap.source else ""
        digest = hashlib.sha256(content).hexdigest()
        entry = TapEntry(tap.id, digest, about.created.isoformat(), about.tool, about.direction, source)
        told = {name: value for name, value in asdict(entry).items() if name != "accepted"}
        self._append({"kind": "tap", "size": len(content), **told})
        shutil.rmtree(self.spool / tap.id, ignore_errors=True)

    def accept(self, tap_id: str, code: str) -> None:
        """Write down that a person has accepted what was asked of a tap test; saved for good when this returns."""
        with self.locked():
            self._append({"kind": "accept", "tap": tap_id, "code": code, "time": datetime.now(UTC).isoformat()})

    def _file(self, tap_id: str) -> Path:
        return self.path / "taps" / f"{tap_id}.h5"

    def _append(self, entry: dict[str, Any]) -> None:
        """One write, one fsync; a line torn off by a crash before is cut away first."""
        whole = self._whole_lines()
        if self._journal.exists() and self._journal.stat().st_size > len(whole):
            os.truncate(self._journal, len(whole))
        last = whole.splitlines()[-1] if whole else b""
        entry["previous"] = hashlib.sha256(last).hexdigest() if last else ""
        entry["crc"] = _crc(entry)
        line = json.dumps(entry).encode() + b"\n"
        handle = os.open(self._journal, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
        try:
            if os.write(handle, line) < len(line):  # what a full disk does with the last bytes it has
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            os.fsync(handle)
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self._journal)) from error
        finally:
            os.close(handle)

    def _whole_lines(self) -> bytes:
        content = self._journal.read_bytes() if self._journal.exists() else b""
        return content[: content.rfind(b"\n") + 1]

    def _lines(self) -> list[dict[str, Any]]:
        """Journal entries; a torn last line counts for nothing, DataError for a damaged one before it."""
        entries = []
        previous = ""
        for number, line in enumerate(self._whole_lines().splitlines(), 1):
            entry = _parsed(line)
            if entry is None or entry["previous"] != previous:
                raise DataError(f"{self._journal}: line {number} is damaged; put the journal back from a backup")
            previous = hashlib.sha256(line).hexdigest()
            entries.append(entry)
        return entries


def _parsed(line: bytes) -> dict[str, Any] | None:
    try:
        entry: dict[str, Any] = json.loads(line)
        return entry if entry["crc"] == _crc(entry) else None
    except (ValueError, KeyError, TypeError):
        return None


def _crc(entry: dict[str, Any]) -> int:
    """CRC-32 of a journal entry without its crc."""
    return zlib.crc32(json.dumps({k: v for k, v in entry.items() if k != "crc"}, sort_keys=True).encode())
