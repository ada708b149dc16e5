"""Prepare tap files from recorded files, in this process or in workers.

Nothing of it depends on another file, so others can share the work; what they find is equal bit by bit.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import lru_cache
from pathlib import Path
from typing import Any, Self, TypeVar

from acquisition import DataError, Description, Recording, TapTest, read_tap
from acquisition.file_io import make_folder
from acquisition.files.tap_file import encode_tap, round_as_stored
from lobewatch.logbook.recordings.recorded_files import MachineContext, read_tap_test
from lobewatch.machine import MachineFolder, TapEntry
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.measurement.share_work import Workers, share_work
from lobewatch.measurement.tap_measurement import TapFit, fit_tap, is_fit_of

Result = TypeVar("Result")


@dataclass(frozen=True, eq=False)
class InterpretedFile:
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
    assumed_facts: tuple[str, ...]
    """Facts that were taken for granted where the file does not say them."""


@dataclass(frozen=True)
class FileRequest:
    """One file, with all that another computer has to know of it."""

    file: Path
    """Path of the file, from the root on."""
    content: bytes
    """All of it."""
    description: Description
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
            return cls(file.absolute(), b"", said, machine_toml, explain_file_error(file, error))


def draft_tap(folder: MachineFolder, file: Path, description: Description) -> TapDraft:
    """A file where it lies; DataError, OSError or ValueError where it cannot be used."""
    return _make_draft(MachineContext.of(folder), file, description, file.read_bytes(), file)


def draft_tap_from_request(asked: FileRequest) -> TapDraft | str:
    """A file from its bytes, or why it cannot be used."""
    return _run_on_bytes(asked, _make_draft)


def interpret_file(folder: MachineFolder, file: Path, description: Description) -> InterpretedFile:
    """As `draft_tap`, and no tap file is made."""
    return _interpret(MachineContext.of(folder), file, description, file.read_bytes(), file)


def interpret_request(asked: FileRequest) -> InterpretedFile | str:
    """As `draft_tap_from_request`, and no tap file is made."""
    return _run_on_bytes(asked, _interpret)


def is_valid_draft(asked: FileRequest, answer: Any) -> bool:
    """Whether an answer can be that of `draft_tap_from_request`: its tap file is read, and all else must be of it."""
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
        and is_fit_of(answer.fit, answer.entry)
        and all(isinstance(fact, str) for fact in answer.assumed_facts)
    )


def is_valid_interpretation(_asked: FileRequest, answer: Any) -> bool:
    """Whether an answer can be that of `interpret_request`."""
    if isinstance(answer, str):
        return True
    kinds = isinstance(answer.tap, TapTest) and isinstance(answer.recording, Recording)
    return isinstance(answer, InterpretedFile) and kinds and is_fit_of(answer.fit, TapEntry.of(answer.tap, b""))


def _run_on_bytes(
    asked: FileRequest, work: Callable[[MachineContext, Path, Description, bytes, Path], Result]
) -> Result | str:
    if asked.fault:
        return asked.fault
    with tempfile.TemporaryDirectory(prefix="lobewatch-") as folder:
        at = Path(folder) / asked.file.name
        at.write_bytes(asked.content)
        try:
            return work(_parse_context(asked.machine_toml), asked.file, asked.description, asked.content, at)
        except (DataError, OSError, ValueError) as error:
            return explain_file_error(at, error).replace(str(at), str(asked.file)).removeprefix(f"{asked.file}: ")


def explain_file_error(file: Path, error: Exception) -> str:
    """An error about a file, without its name."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return str(error).removeprefix(f"{file}: ")


def _make_draft(setup: MachineContext, file: Path, description: Description, content: bytes, at: Path) -> TapDraft:
    """at: where the content lies."""
    understood = _interpret(setup, file, description, content, at)
    defaults = tuple(f"{fact.name} {fact.value}" for fact in understood.recording.facts if fact.origin == "default")
    packed, created = encode_tap(understood.tap), understood.tap.circumstances.created
    digest = hashlib.sha256(content).hexdigest()
    return TapDraft(digest, packed, TapEntry.of(understood.tap, packed), created, understood.fit, defaults)


def _interpret(
    setup: MachineContext, file: Path, description: Description, content: bytes, at: Path
) -> InterpretedFile:
    tap, recording = read_tap_test(setup, file, description, content, at)
    return InterpretedFile(tap, replace(recording, path=file), fit_tap(round_as_stored(tap), setup.machine))


@lru_cache(maxsize=4)
def _parse_context(machine_toml: str) -> MachineContext:
    """Read once in a process."""
    return MachineContext(parse_machine_file(machine_toml), machine_toml)


@dataclass(frozen=True, eq=False)
class PreparedTap:
    """One file."""

    digest: str
    """SHA-256 of the file."""
    temporary_path: Path
    """Path of its tap file under a temporary name."""
    entry: TapEntry
    """Journal entry of that."""
    created: datetime
    """Time of the recording."""
    fit: TapFit
    """The modes in it."""
    assumed_facts: tuple[str, ...]
    """Facts that were taken for granted where the file does not say them."""


def prepare_tap(folder: MachineFolder, file: Path, description: Description) -> PreparedTap:
    """One file; DataError, OSError or ValueError where it cannot be used."""
    return _write_prepared(folder, draft_tap(folder, file, description))


def prepare_all_taps(
    folder: MachineFolder, files: Sequence[Path], description: Description, workers: Workers
) -> Iterator[PreparedTap | str]:
    """Each file in turn, or why it cannot be used; DataError as `share_work`."""
    if not workers.use_other_processes:
        yield from (_prepare_or_explain(folder, file, description) for file in files)
        return
    toml = folder.toml_text
    asked = (FileRequest.of(file, description, toml) for file in files)
    for draft in share_work(draft_tap_from_request, asked, workers, is_valid_draft):
        yield draft if isinstance(draft, str) else _write_prepared(folder, draft)


def remove_prepared_files(folder: MachineFolder) -> None:
    """Take away tap files that were made ready and not stored; to be called under the lock."""
    for path in (folder.path / "taps").glob(".*.h5.ready"):
        path.unlink()


def _prepare_or_explain(folder: MachineFolder, file: Path, description: Description) -> PreparedTap | str:
    try:
        return prepare_tap(folder, file, description)
    except (DataError, OSError, ValueError) as error:
        return explain_file_error(file, error)


def _write_prepared(folder: MachineFolder, draft: TapDraft) -> PreparedTap:
    taps = folder.path / "taps"
    make_folder(taps)
    path = taps / f".{draft.entry.id}.h5.ready"
    with path.open("xb") as file:
        file.write(draft.content)
        file.flush()
        os.fsync(file.fileno())
    return PreparedTap(draft.digest, path, draft.entry, draft.created, draft.fit, draft.assumed_facts)
