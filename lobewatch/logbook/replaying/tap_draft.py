"""What one recorded file becomes, worked out from its bytes alone: by this process or by any other, on any computer."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import Any, Self, TypeVar

from acquisition import DataError, Description, Recording, TapTest, read_tap
from acquisition.files.tap_file import as_written, tap_content
from lobewatch.logbook.replaying.read_tap_test import Setup, read_tap_test
from lobewatch.machine import MachineFolder, TapEntry
from lobewatch.machine.settings.machine_file import parse_machine
from lobewatch.measuring.measurement import TapFit, fit_tap
from lobewatch.measuring.workers.is_fit import is_fit

Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class FileReading:
    """One file, before anything is made of it."""

    tap: TapTest
    """The tap test that it would be."""
    recording: Recording
    """Recording as it is understood."""
    fit: TapFit
    """The modes in it."""


@dataclass(frozen=True)
class TapDraft:
    """One file."""

    digest: str
    """SHA-256 of the file."""
    content: bytes
    """Bytes of its tap file."""
    entry: TapEntry
    """Journal entry of that."""
    created: datetime
    """Time of the recording."""
    fit: TapFit
    """The modes in it."""
    taken: tuple[str, ...]
    """Facts that were taken for granted where the file does not say them."""


@dataclass(frozen=True)
class FileRequest:
    """One file, with all that another computer has to know of it."""

    file: Path
    """Path of the file, from the root on."""
    content: bytes
    """All of it."""
    said: Description
    """Description that a person gives of it."""
    machine_toml: str
    """The machine that it is of."""
    fault: str = ""
    """Reason why it cannot be read; empty where it can."""

    @classmethod
    def of(cls, file: Path, description: Description, machine_toml: str) -> Self:
        """Read now."""
        said = replace(description, force=description.force and description.force.absolute())
        try:
            return cls(file.absolute(), file.read_bytes(), said, machine_toml)
        except OSError as error:
            return cls(file.absolute(), b"", said, machine_toml, reason_of(file, error))


def draft_tap(folder: MachineFolder, file: Path, description: Description) -> TapDraft:
    """A file where it lies; DataError, OSError or ValueError where it cannot be used."""
    return _draft(Setup.of(folder), file, description, file.read_bytes(), file)


def draft_requested_tap(asked: FileRequest) -> TapDraft | str:
    """A file from its bytes, or why it cannot be used."""
    return _from_bytes(asked, _draft)


def read_file(folder: MachineFolder, file: Path, description: Description) -> FileReading:
    """As `draft_tap`, and no tap file is made."""
    return _reading(Setup.of(folder), file, description, file.read_bytes(), file)


def read_requested_file(asked: FileRequest) -> FileReading | str:
    """As `draft_requested_tap`, and no tap file is made."""
    return _from_bytes(asked, _reading)


def is_draft(asked: FileRequest, answer: Any) -> bool:
    """Whether an answer can be that of `draft_requested_tap`: its tap file is read, and all else must be of it."""
    if isinstance(answer, str):
        return True
    with tempfile.TemporaryDirectory(prefix="lobewatch-") as folder:
        at = Path(folder) / "tap.h5"
        at.write_bytes(answer.content)
        tap = read_tap(at)
    return (
        isinstance(answer, TapDraft)
        and answer.digest == hashlib.sha256(asked.content).hexdigest() == answer.entry.source_sha256
        and answer.entry == TapEntry.of(tap, answer.content)
        and answer.created == tap.circumstances.created
        and is_fit(answer.fit, answer.entry)
        and all(isinstance(fact, str) for fact in answer.taken)
    )


def is_reading(_asked: FileRequest, answer: Any) -> bool:
    """Whether an answer can be that of `read_requested_file`."""
    if isinstance(answer, str):
        return True
    kinds = isinstance(answer.tap, TapTest) and isinstance(answer.recording, Recording)
    return isinstance(answer, FileReading) and kinds and is_fit(answer.fit, TapEntry.of(answer.tap, b""))


def _from_bytes(asked: FileRequest, work: Callable[[Setup, Path, Description, bytes, Path], Result]) -> Result | str:
    if asked.fault:
        return asked.fault
    with tempfile.TemporaryDirectory(prefix="lobewatch-") as folder:
        at = Path(folder) / asked.file.name
        at.write_bytes(asked.content)
        try:
            return work(_setup(asked.machine_toml), asked.file, asked.said, asked.content, at)
        except (DataError, OSError, ValueError) as error:
            return reason_of(at, error).replace(str(at), str(asked.file)).removeprefix(f"{asked.file}: ")


def reason_of(file: Path, error: Exception) -> str:
    """An error about a file, without its name."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return str(error).removeprefix(f"{file}: ")


def _draft(setup: Setup, file: Path, description: Description, content: bytes, at: Path) -> TapDraft:
    """at: where the content lies."""
    understood = _reading(setup, file, description, content, at)
    defaults = tuple(f"{fact.name} {fact.value}" for fact in understood.recording.facts if fact.origin == "default")
    packed, created = tap_content(understood.tap), understood.tap.circumstances.created
    digest = hashlib.sha256(content).hexdigest()
    return TapDraft(digest, packed, TapEntry.of(understood.tap, packed), created, understood.fit, defaults)


def _reading(setup: Setup, file: Path, description: Description, content: bytes, at: Path) -> FileReading:
    tap, recording = read_tap_test(setup, file, description, content, at)
    return FileReading(tap, replace(recording, path=file), fit_tap(as_written(tap), setup.machine))


@lru_cache(maxsize=4)
def _setup(machine_toml: str) -> Setup:
    """Read once in a process."""
    return Setup(parse_machine(machine_toml), machine_toml)
