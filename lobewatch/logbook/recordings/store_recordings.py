"""Store recorded files as tap tests of a machine, each once."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from acquisition import DataError, Description, TapTest
from lobewatch.logbook.recordings.prepare_taps import (
    PreparedTap,
    explain_file_error,
    prepare_all_taps,
    prepare_tap,
    remove_prepared_files,
)
from lobewatch.machine import MachineFolder, TapEntry
from lobewatch.measurement.share_work import Workers
from lobewatch.measurement.tap_measurement import TapFit

MAX_NAMED_FILES = 3
"""Files that are named of those of which the same is said; the others are counted."""


def group_by_message(said: Iterable[tuple[str, str]]) -> list[str]:
    """A line for each sentence, in the order of the first file of each; said: names of files, each with a sentence."""
    files: dict[str, list[str]] = {}
    for file, sentence in said:
        files.setdefault(sentence, []).append(file)
    return [f"{_join_file_names(names)}: {sentence}" for sentence, names in files.items()]


def _join_file_names(files: list[str]) -> str:
    more = len(files) - MAX_NAMED_FILES
    return ", ".join(files[:MAX_NAMED_FILES]) + (f" and {more} more" if more > 0 else "")


ReplayProgressCallback = Callable[[str, int, int], None]
"""Told what is done ("read", "store"), how many of it are, and of how many."""

LOCAL_WORKERS = Workers()


@dataclass(frozen=True)
class ReplayOutcome:
    """What came of some recorded files."""

    tap_ids: Sequence[str]
    """The tap test of each file that was not refused, in the order of the files."""
    already_stored: Mapping[Path, str]
    """Files that were stored already, or stand twice among those given, and their tap test."""
    new_tap_ids: Sequence[str]
    """The tap tests that are new, oldest first."""
    rejected: Mapping[Path, str] = field(default_factory=dict)
    """Files that cannot be used, and why."""
    assumed_facts: Sequence[str] = ()
    """Facts that were taken for granted where files do not say them, each once."""
    fits: Mapping[str, TapFit] = field(default_factory=dict)
    """The modes of the new tap tests, by identity."""


@dataclass
class StoredContents:
    """Which contents are stored already, and as which tap test."""

    by_digest: dict[str, list[tuple[str, str]]]
    """SHA-256 -> identities of tap tests and their directions."""

    @classmethod
    def of(cls, taps: Sequence[TapEntry]) -> StoredContents:
        """Those of committed tap tests, by their file and by the file that they were replayed from."""
        contents = cls({})
        for tap in taps:
            for digest in filter(None, (tap.source_sha256, tap.sha256)):
                contents.by_digest.setdefault(digest, []).append((tap.id, tap.direction))
        return contents

    def find_tap(self, digest: str, description: Description) -> str | None:
        """The tap test of a content; one of several responses is known only where it is stored in this direction."""
        for tap_id, direction in self.by_digest.get(digest, ()):
            if description.response is None or direction == (description.direction or direction):
                return tap_id
        return None

    def add(self, digest: str, tap: TapTest) -> None:
        """A tap test that is going to be stored."""
        self.by_digest.setdefault(digest, []).append((tap.id, tap.circumstances.direction))


def store_recordings(
    folder: MachineFolder,
    files: Sequence[Path],
    description: Description,
    *,
    workers: Workers = LOCAL_WORKERS,
    keep_going: bool = False,
    progress: ReplayProgressCallback = lambda _what, _done, _of: None,
) -> ReplayOutcome:
    """Commit recorded files, each once, oldest first; all are read and judged before the first one is stored.

    DataError, and nothing is stored, where one cannot be used, with all of these; keep_going: the others are stored.
    workers: who reads and fits; what they find is the same. To be called under the lock.
    """
    remove_prepared_files(folder)
    digests, unread = compute_digests(files)
    if unread and len(files) == 1:
        raise unread[files[0]]
    refused = {file: explain_file_error(file, error) for file, error in unread.items()}
    contents, todo = StoredContents.of(folder.taps()), dict[str, Path]()
    ids = {digest: contents.find_tap(digest, description) or "" for digest in digests.values()}
    for file, digest in digests.items():
        if not ids[digest]:
            todo.setdefault(digest, file)
    try:
        ready, wrong = _prepare_files(folder, todo, description, workers, alone=len(files) == 1, progress=progress)
        refused |= {file: wrong[digest] for file, digest in digests.items() if digest in wrong}
        if refused and not (keep_going and len(refused) < len(files)):
            raise DataError(format_rejections({file: refused[file] for file in files if file in refused}, len(files)))
        ready.sort(key=lambda tap: tap.created)
        if ready:
            folder.commit_files({tap.temporary_path: tap.entry for tap in ready})
            progress("store", len(ready), len(ready))
    finally:
        remove_prepared_files(folder)
    ids |= {tap.digest: tap.entry.id for tap in ready}
    used = {file: ids[digests[file]] for file in files if file not in refused}
    known = {file: tap_id for file, tap_id in used.items() if todo.get(digests[file]) != file}
    taken = dict.fromkeys(text for tap in ready for text in tap.assumed_facts)
    fits = {tap.entry.id: tap.fit for tap in ready}
    return ReplayOutcome([used[file] for file in files if file in used], known, [*fits], refused, list(taken), fits)


def compute_digests(files: Sequence[Path]) -> tuple[dict[Path, str], dict[Path, OSError]]:
    """SHA-256 of each file, and what is wrong with those that cannot be read."""
    digests, unread = dict[Path, str](), dict[Path, OSError]()
    for file in files:
        try:
            digests[file] = hashlib.sha256(file.read_bytes()).hexdigest()
        except OSError as error:
            unread[file] = error
    return digests, unread


def _prepare_files(
    folder: MachineFolder,
    todo: Mapping[str, Path],
    description: Description,
    workers: Workers,
    *,
    alone: bool,
    progress: ReplayProgressCallback,
) -> tuple[list[PreparedTap], dict[str, str]]:
    """Files by their digests, made ready; by digest why some cannot be used, the error itself where it stands alone."""
    if alone and not workers.scheduler:
        return [prepare_tap(folder, file, description) for file in todo.values()], {}
    ready, wrong = list[PreparedTap](), dict[str, str]()
    results = zip(todo, prepare_all_taps(folder, [*todo.values()], description, workers), strict=True)
    for number, (digest, result) in enumerate(results, 1):
        if isinstance(result, str):
            wrong[digest] = result
        elif result.digest != digest:
            wrong[digest] = "it changes while it is read; wait until it is written"
        else:
            ready.append(result)
        progress("read", number, len(todo))
    return ready, wrong


def format_rejections(refused: Mapping[Path, str], n: int, *, stored: bool = False) -> str:
    """All files that cannot be used, and what can be done; stored: the others are."""
    lines = group_by_message((str(file), why) for file, why in refused.items())
    if len(refused) == n:
        return "\n".join([f"none of the {n} files can be used; nothing is stored", *lines])
    rest_text = "the others are stored" if stored else "nothing is stored; --keep-going stores the others"
    if len(refused) == 1:
        return f"{lines[0]} (1 of {n} files; {rest_text})"
    return "\n".join([f"{len(refused)} of {n} files cannot be used; {rest_text}", *lines])
