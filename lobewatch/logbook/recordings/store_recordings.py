"""Store recorded files as tap tests of a machine, each once."""

import hashlib
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from itertools import chain, pairwise
from pathlib import Path
from typing import NamedTuple, Self

from acquisition import DataError, Description, Remark
from acquisition.errors import join_sentences
from lobewatch.logbook.recordings import prepare_taps
from lobewatch.logbook.recordings.prepare_taps import HitCount, TapDraft
from lobewatch.logbook.recordings.recorded_files import CHANGING_FILE_TEXT, read_source
from lobewatch.machine import MachineFolder
from lobewatch.measurement.share_work import Workers
from lobewatch.measurement.tap_measurement import TapFit

MAX_NAMED_FILES = 3
"""Number of files that a message names; it counts the others."""


def group_by_message(messages: Iterable[tuple[str, str]]) -> list[str]:
    """Group files by message. Return one line for each message, in the order of its first file."""
    files: dict[str, list[str]] = {}
    for file, message in messages:
        files.setdefault(message, []).append(file)
    return [f"{_join_file_names(names)}: {message}" for message, names in files.items()]


def _join_file_names(files: list[str]) -> str:
    more = len(files) - MAX_NAMED_FILES
    return ", ".join(files[:MAX_NAMED_FILES]) + (f" and {more} more" if more > 0 else "")


ProgressCallback = Callable[[str, int, int], None]
"""Callback for progress: step ("read", "store", "measure"), number of finished files, and of all."""
StoredCallback = Callable[[TapFit, bool], None]
"""Callback for each stored tap test: its fit, and whether more tap tests follow."""

LOCAL_WORKERS = Workers()
"""Workers of a replay without other processes."""


@dataclass(frozen=True)
class ReplayOutcome:
    """Result of a replay."""

    tap_ids: Sequence[str]
    """Tap test of each usable file, in the order of the files."""
    already_stored: Mapping[Path, str]
    """Tap test of each file that was stored already or is given twice."""
    new_tap_ids: Sequence[str]
    """New tap tests, oldest first."""
    rejected: Mapping[Path, str] = field(default_factory=dict)
    """Reason for each file that cannot be used."""
    assumed_facts: Sequence[str] = ()
    """Defaults assumed for facts that files do not state, each once."""
    fits: Mapping[str, TapFit] = field(default_factory=dict)
    """Fitted modes of the new tap tests, by identity."""
    unused_hits: Mapping[Path, str] = field(default_factory=dict)
    """Hits that are not averaged, in words, for each new file with such hits."""
    hit_counts: Mapping[str, HitCount] = field(default_factory=dict)
    """Number of hits found and used in the new tap tests, by identity."""
    remarks: Sequence[Remark] = ()
    """Remarks on hits that are left out, and on tap tests of one hit each."""
    decided_tap_ids: Sequence[str] = ()
    """Tap tests that were stored already and got decisions on hits."""


class ReplayPlan(NamedTuple):
    """Contents of the files of a replay."""

    digests: dict[Path, str]
    """SHA-256 of each file."""
    unread: dict[Path, OSError]
    """Error of each unreadable file."""
    stored: dict[str, str]
    """Tap test of each content in the machine folder, by SHA-256."""
    new: dict[str, Path]
    """First file of each other content, by SHA-256."""

    @classmethod
    def of(cls, folder: MachineFolder, files: Sequence[Path], description: Description) -> Self:
        """Read the files. The tap test of one of several responses must have the same direction.

        Raises ValueError for decisions on the hits of several files that are not one new tap test.
        """
        if description.hit_decisions and len(files) > 1:
            cure = "Replay the files one by one, or give Description.one_test."
            raise ValueError(f"decisions on hits need one file, not {len(files)}. {cure}")
        plan = cls(*_hash_files(files, description), {}, {})
        for tap in reversed(folder.taps()):  # the first one counts
            if description.response is None or tap.direction == (description.direction or tap.direction):
                plan.stored.update(dict.fromkeys(filter(None, (tap.source_sha256, tap.sha256)), tap.id))
        for file, digest in plan.digests.items():
            if digest not in plan.stored:
                plan.new.setdefault(digest, file)
        if description.hit_files:
            _reject_new_decisions(folder, {plan.stored.get(digest) for digest in plan.digests.values()}, description)
        return plan


def _hash_files(files: Sequence[Path], description: Description) -> tuple[dict[Path, str], dict[Path, OSError]]:
    """Return the SHA-256 of each file, and the error of each unreadable one."""
    digests, unread = dict[Path, str](), dict[Path, OSError]()
    for file in files:
        try:
            digests[file] = hashlib.sha256(read_source(file, description)).hexdigest()
        except OSError as error:
            unread[file] = error
    return digests, unread


def _reject_new_decisions(folder: MachineFolder, known: Collection[str | None], description: Description) -> None:
    """Reject new decisions on stored hits of several files: the order of the files may be another one now."""
    for tap in folder.taps():
        if tap.id in known and not set(description.hit_decisions) <= set(tap.hit_decisions):
            cure = "Decide on the hits of the stored tap test instead."
            raise ValueError(f"the files are stored already as {tap.id}, perhaps in another order. {cure}")


def store_recordings(
    folder: MachineFolder,
    files: Sequence[Path],
    description: Description,
    *,
    workers: Workers = LOCAL_WORKERS,
    keep_going: bool = False,
    progress: ProgressCallback = lambda _what, _done, _of: None,
    on_stored: StoredCallback = lambda _fit, _more: None,
) -> ReplayOutcome:
    """Store recorded files as tap tests, each once and oldest first. Call it under the lock.

    All files are checked before the first one is stored. Each tap test is stored as soon as it is fitted, so an
    interrupted call keeps the stored ones, and the next call continues.

    Parameters
    ----------
    folder
        Folder of the machine.
    files
        Paths of the recorded files.
    description
        Facts that the files do not state.
    workers
        Processes that read and fit. The result does not depend on them.
    keep_going
        Whether usable files are stored if others are rejected.
    progress
        Callback for progress.
    on_stored
        Callback for each stored tap test.

    Returns
    -------
    ReplayOutcome
        Tap tests, rejected files and assumed defaults.

    Raises
    ------
    DataError
        If a check finds a file that cannot be used. Nothing is stored then.
    """
    prepare_taps.remove_prepared_files(folder)
    digests, unread, stored, new = ReplayPlan.of(folder, files, description)
    if unread and len(files) == 1:
        raise unread[files[0]]
    rejected = {file: prepare_taps.explain_file_error(file, error) for file, error in unread.items()}
    try:
        if len(files) > 1 or workers.scheduler:
            dates, faults = _check_files(folder, new, description, progress)
            rejected |= {file: faults[digest] for file, digest in digests.items() if digest in faults}
            if rejected and not (keep_going and len(rejected) < len(files)):
                why = {file: rejected[file] for file in files if file in rejected}
                raise DataError(format_rejections(why, len(files)))
            oldest_first = {digest: new[digest] for digest in sorted(dates, key=dates.__getitem__)}
            results = prepare_taps.prepare_all_taps(folder, [*oldest_first.values()], description, workers)
        else:
            oldest_first = new
            results = (prepare_taps.prepare_tap(folder, file, description) for file in new.values())
        ready, faults = _store_each(folder, oldest_first, results, progress, on_stored)
        rejected |= {file: faults[digest] for file, digest in digests.items() if digest in faults}
        if rejected and len(rejected) == len(files):
            raise DataError(format_rejections(rejected, len(files)))
    finally:
        prepare_taps.remove_prepared_files(folder)
    ids = stored | {tap.digest: tap.entry.id for tap in ready}
    used = {file: ids[digests[file]] for file in files if file not in rejected}
    already_stored = {file: tap_id for file, tap_id in used.items() if new.get(digests[file]) != file}
    assumed_facts = list(dict.fromkeys(text for tap in ready for text in tap.assumed_facts))
    fits = {tap.entry.id: tap.fit for tap in ready}
    tap_ids = [used[file] for file in files if file in used]
    counts = {tap.entry.id: tap.hit_count for tap in ready}
    remarks = [*chain.from_iterable(tap.remarks for tap in ready), *find_one_hit_tests(ready)]
    unused_hits = {new[tap.digest]: tap.unused_hits for tap in ready if tap.unused_hits}
    done = tap_ids, already_stored, [*fits], rejected, assumed_facts, fits
    return ReplayOutcome(*done, unused_hits, hit_counts=counts, remarks=remarks)


MAX_HIT_PAUSE = timedelta(hours=1)
"""Largest time from one hit of a tap test to the next; chosen."""


def find_one_hit_tests(stored: Sequence[TapDraft]) -> list[Remark]:
    """Return a remark if several tap tests of one hit each follow each other, as the hits of one tap test do."""
    series = {(tap.entry.tool, tap.entry.direction) for tap in stored}
    times = sorted(tap.created for tap in stored)
    is_close = all(later - earlier <= MAX_HIT_PAUSE for earlier, later in pairwise(times))
    if len(stored) < 2 or len(series) > 1 or not is_close or any(tap.hit_count.found != 1 for tap in stored):
        return []
    text = f"{len(stored)} files with one hit each became {len(stored)} tap tests"
    cure = "If they are hits of one tap test, exclude these tests and replay the files with Description.one_test"
    return [Remark("one-hit-tests", "", text, cure)]


def _check_files(
    folder: MachineFolder, new: dict[str, Path], description: Description, progress: ProgressCallback
) -> tuple[dict[str, datetime], dict[str, str]]:
    """Return the date of each usable file and the reason for each other one, by digest."""
    dates, faults = dict[str, datetime](), dict[str, str]()
    progress("read", 0, len(new))
    checks = prepare_taps.check_files(folder, [*new.values()], description)
    for number, (digest, result) in enumerate(zip(new, checks, strict=True), 1):
        if isinstance(result, str):
            faults[digest] = result
        else:
            dates[digest] = result
        progress("read", number, len(new))
    return dates, faults


def _store_each(
    folder: MachineFolder,
    new: dict[str, Path],
    results: Iterable[TapDraft | str],
    progress: ProgressCallback,
    on_stored: StoredCallback,
) -> tuple[list[TapDraft], dict[str, str]]:
    """Store each tap test as soon as it is prepared. Return the reason for each file that changed meanwhile too."""
    stored, faults = list[TapDraft](), dict[str, str]()
    progress("store", 0, len(new))
    for number, (digest, result) in enumerate(zip(new, results, strict=True), 1):
        if isinstance(result, str):
            faults[digest] = result
        elif result.digest != digest:
            faults[digest] = CHANGING_FILE_TEXT
        else:
            folder.commit_files({prepare_taps.prepared_path(folder, result): result.entry})
            stored.append(result)
            on_stored(result.fit, number < len(new))
        progress("store", number, len(new))
    return stored, faults


def format_rejections(rejected: Mapping[Path, str], n: int, *, stored: bool = False) -> str:
    """Format the reasons for rejected files of n, and whether the others are stored."""
    lines = group_by_message((str(file), why) for file, why in rejected.items())
    if len(rejected) == n:
        return "\n".join([f"none of the {n} files can be used. Nothing was stored.", *lines])
    nothing = "so nothing was stored. Use store_recordings.keep_going to store the other files."
    summary = f"{len(rejected)} of {n} files cannot be used, {'the other files were stored' if stored else nothing}"
    return join_sentences(lines[0], summary) if len(rejected) == 1 else "\n".join([summary, *lines])
