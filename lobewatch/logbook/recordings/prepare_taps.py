"""Prepare tap files from recorded files, in this process or in workers.

Each file is independent of all others, so that workers can share the files. Their results are identical.
"""

import hashlib
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, Self, TypeVar

from acquisition import DataError, Description, Recording, Remark, TapTest
from acquisition.file_io import delete, make_folder
from acquisition.files.tap_file import encode_tap, round_as_stored
from lobewatch.logbook.recordings.recorded_files import (
    MachineContext,
    parse_context,
    read_source,
    read_tap_bytes,
    read_tap_test,
)
from lobewatch.machine import MachineFolder, TapEntry
from lobewatch.measurement.hit_choice import format_unused_hits
from lobewatch.measurement.share_work import Workers, share_work
from lobewatch.measurement.tap_measurement import TapFit, fit_tap, is_fit_of

Result = TypeVar("Result")
FileWork = Callable[[MachineContext, Path, Description, bytes, Path], Result]
"""Work on a file: machine, path, facts that the file does not state, content, and path where this can be read."""


class InterpretedFile(NamedTuple):
    """Recorded file, interpreted as a tap test."""

    tap: TapTest
    """Tap test of the file."""
    recording: Recording
    """Recording with its facts."""
    fit: TapFit
    """Fitted modes."""


class HitCount(NamedTuple):
    """Number of hits of a tap test."""

    found: int
    """Number of hits found, with those that cannot be used; 0 for an FRF."""
    used: int
    """Number of averaged hits."""


class TapDraft(NamedTuple):
    """Tap file made from a recorded file."""

    digest: str
    """SHA-256 of the recorded file."""
    content: bytes
    """Content of the tap file. Empty after it was written."""
    entry: TapEntry
    """Journal entry of the tap file."""
    created: datetime
    """Time of the recording."""
    fit: TapFit
    """Fitted modes."""
    assumed_facts: tuple[str, ...]
    """Defaults assumed for facts that the file does not state."""
    unused_hits: str = ""
    """Hits that are not averaged, in words. Empty if all are."""
    hit_count: HitCount = HitCount(0, 0)
    """Number of hits found and used."""
    remarks: tuple[Remark, ...] = ()
    """Remarks on hits and files that are left out."""


class FileRequest(NamedTuple):
    """Recorded file with everything that a worker needs."""

    file: Path
    """Absolute path of the file."""
    content: bytes
    """Content of the file."""
    description: Description
    """Facts that the file does not state."""
    machine_toml: str
    """Content of machine.toml."""
    fault: str = ""
    """Reason why the file cannot be read. Empty if it can."""

    @classmethod
    def of(cls, file: Path, description: Description, machine_toml: str) -> Self:
        """Read the file."""
        description = replace(description, force=description.force and description.force.absolute())
        try:
            return cls(file.absolute(), read_source(file, description), description, machine_toml)
        except OSError as error:
            return cls(file.absolute(), b"", description, machine_toml, explain_file_error(file, error))


def is_valid_draft(request: FileRequest, answer: Any) -> bool:
    """Check a draft from a worker against its own tap file."""
    tap = replace(read_tap_bytes(answer.content), decisions=answer.entry.hit_decisions)
    return (
        isinstance(answer, TapDraft)
        and answer.digest == hashlib.sha256(request.content).hexdigest() == answer.entry.source_sha256
        and {*request.description.hit_decisions} <= {*tap.decisions}
        and answer.entry == TapEntry.of(tap, answer.content)
        and answer.created == tap.circumstances.created
        and is_fit_of(answer.fit, answer.entry)
        and all(isinstance(text, str) for text in (*answer.assumed_facts, answer.unused_hits))
        and answer.hit_count.used == len(tap.accepted) <= len(tap.hits) <= answer.hit_count.found
        and all(isinstance(remark, Remark) for remark in answer.remarks)
    )


def is_valid_interpretation(_request: FileRequest, answer: Any) -> bool:
    """Check an interpreted file from a worker."""
    is_typed = isinstance(answer.tap, TapTest) and isinstance(answer.recording, Recording)
    return isinstance(answer, InterpretedFile) and is_typed and is_fit_of(answer.fit, TapEntry.of(answer.tap, b""))


def work_on_files(
    folder: MachineFolder,
    files: Sequence[Path],
    description: Description,
    workers: Workers,
    work: FileWork[Result],
    is_valid: Callable[[FileRequest, Any], bool],
    finish: Callable[[Result], Result] = lambda result: result,
) -> Iterator[Result | str]:
    """Yield the finished result for each file, or the reason why it cannot be used. Errors as `share_work`.

    `is_valid` checks an answer of a worker. `finish` completes a result in this process.
    """
    if workers.use_other_processes and not description.hit_files:
        toml = folder.toml_text
        requests = (FileRequest.of(file, description, toml) for file in files)

        def is_answer(request: FileRequest, answer: Any) -> bool:
            return isinstance(answer, str) or is_valid(request, answer)

        for answer in share_work(partial(_work_on_copy, work), requests, workers, is_answer):
            yield answer if isinstance(answer, str) else finish(answer)
        return
    for file in files:
        try:
            yield finish(work(MachineContext.of(folder), file, description, read_source(file, description), file))
        except (DataError, OSError, ValueError) as error:
            yield explain_file_error(file, error)


def _work_on_copy(work: FileWork[Result], request: FileRequest) -> Result | str:
    """Work on a temporary copy of the file, or return the reason why it cannot be used."""
    if request.fault:
        return request.fault
    with tempfile.TemporaryDirectory(prefix="lobewatch-") as folder:
        copy = Path(folder) / request.file.name
        copy.write_bytes(request.content)
        try:
            return work(parse_context(request.machine_toml), request.file, request.description, request.content, copy)
        except (DataError, OSError, ValueError) as error:
            reason = explain_file_error(copy, error).replace(str(copy), str(request.file))
            return reason.removeprefix(f"{request.file}: ")


def explain_file_error(file: Path, error: Exception) -> str:
    """Return the text of an error about a file, without the name of the file."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return str(error).removeprefix(f"{file}: ")


def _make_draft(context: MachineContext, file: Path, description: Description, content: bytes, at: Path) -> TapDraft:
    tap, recording, fit = interpret_content(context, file, description, content, at)
    defaults = tuple(f"{fact.name} {fact.value}" for fact in recording.facts if fact.origin == "default")
    packed, digest = encode_tap(tap), hashlib.sha256(content).hexdigest()
    count = HitCount(recording.n_found, len(tap.accepted))
    unused = format_unused_hits(tap.decided_flags, recording.places)
    entry, created = TapEntry.of(tap, packed), tap.circumstances.created
    return TapDraft(digest, packed, entry, created, fit, defaults, unused, count, recording.remarks)


def interpret_content(
    context: MachineContext, file: Path, description: Description, content: bytes, at: Path
) -> InterpretedFile:
    """Interpret the content of a file; `at` is the path where this content can be read."""
    tap, recording = read_tap_test(context, file, description, content, at)
    return InterpretedFile(tap, replace(recording, path=file), fit_tap(round_as_stored(tap), context.machine))


def check_files(folder: MachineFolder, files: Sequence[Path], description: Description) -> Iterator[datetime | str]:
    """Read each file as a tap test without a fit. Yield its date, or the reason why it cannot be used."""
    return work_on_files(folder, files, description, Workers(), _read_date, lambda *_: True)


def _read_date(context: MachineContext, file: Path, description: Description, content: bytes, at: Path) -> datetime:
    return read_tap_test(context, file, description, content, at)[0].circumstances.created


def prepare_tap(folder: MachineFolder, file: Path, description: Description) -> TapDraft:
    """Write a recorded file as a tap file with a temporary name. DataError, OSError or ValueError if it is unusable."""
    return _write_draft(
        folder, _make_draft(MachineContext.of(folder), file, description, read_source(file, description), file)
    )


def prepare_all_taps(
    folder: MachineFolder, files: Sequence[Path], description: Description, workers: Workers
) -> Iterator[TapDraft | str]:
    """Prepare each file, or yield the reason why it cannot be used. Errors as `share_work`."""
    write = partial(_write_draft, folder)
    return work_on_files(folder, files, description, workers, _make_draft, is_valid_draft, write)


def remove_prepared_files(folder: MachineFolder) -> None:
    """Remove prepared tap files that were not stored. Call it under the lock."""
    for path in (folder.path / "taps").glob(".*.h5.ready"):
        delete(path)


def prepared_path(folder: MachineFolder, draft: TapDraft) -> Path:
    """Return the temporary path of a prepared tap file."""
    return folder.path / "taps" / f".{draft.entry.id}.h5.ready"


def _write_draft(folder: MachineFolder, draft: TapDraft) -> TapDraft:
    """Write the tap file of a draft, and drop its content from memory."""
    make_folder(folder.path / "taps")
    with prepared_path(folder, draft).open("xb") as file:
        file.write(draft.content)
        file.flush()
        os.fsync(file.fileno())
    return draft._replace(content=b"")
