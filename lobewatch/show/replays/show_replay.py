"""What `lobewatch replay` does once its options are read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from acquisition import DataError, Description
from lobewatch.logbook import Logbook
from lobewatch.logbook.preview import preview_recordings
from lobewatch.logbook.replaying.store import refusal
from lobewatch.measuring.questions import check_codes, unasked_text
from lobewatch.measuring.workers.share_work import Workers
from lobewatch.show.replays.describe_preview import preview_json, preview_summary, preview_texts
from lobewatch.show.replays.describe_replay import replay_json, replay_texts
from lobewatch.show.terminal.output import emit, notes
from lobewatch.show.terminal.progress_bar import ProgressBar


def show_preview(
    logbook: Logbook,
    files: Sequence[Path],
    passed: Sequence[Path],
    said: Description,
    *,
    workers: Workers,
    as_json: bool,
) -> None:
    """Tell what would become of files; DataError where one of them cannot be used."""
    with ProgressBar() as progress:
        previews = preview_recordings(logbook, files, said, progress, workers)
    payload = {"dry_run": True, "files": [preview_json(one) for one in previews], "passed_over": list(map(str, passed))}
    emit(payload, as_json, *preview_texts(previews), preview_summary(previews, len(passed)))
    refused = sum(bool(one.refused) for one in previews)
    if refused:
        raise DataError(f"{refused} of {len(files)} file(s) cannot be used as they are; the reasons stand above")


def show_replay(
    logbook: Logbook,
    files: Sequence[Path],
    passed: Sequence[Path],
    said: Description,
    accept: Sequence[str],
    *,
    workers: Workers,
    keep_going: bool,
    as_json: bool,
) -> None:
    """Store files, accept what is asked of them, tell what they say; DataError for those that cannot be used."""
    codes = check_codes(accept)
    with ProgressBar() as progress:
        stored = logbook.replay_all(files, said, workers=workers, keep_going=keep_going, progress=progress)
    unasked = logbook.accept(stored.tap_ids, codes)
    _tell_known(stored.known, len(files))
    if passed:
        notes.print(f"passed over: {len(passed)} other files, such as {passed[0].name}", markup=False)
    accepted = [code for code in codes if code not in unasked]
    payload = {}
    if as_json:
        payload = replay_json(stored, logbook) | {"accepted": accepted, "questions": logbook.questions}
    texts = [] if as_json else [*replay_texts(stored, logbook), *(f"accepted: {code}" for code in accepted)]
    last = f"{len(stored.fresh)} of {len(files)} file(s) stored in {logbook.folder.path}"
    emit(payload, as_json, *texts, last)
    if stored.refused:
        raise DataError(refusal(stored.refused, len(files), stored=True))
    if unasked:
        raise ValueError(unasked_text(unasked, stored.tap_ids, logbook.questions))


def _tell_known(known: Mapping[Path, str], n: int) -> None:
    """Files that were stored already: each where they are few."""
    if n > 12 and len(known) > 3:
        notes.print(f"{len(known)} of {n} files are stored already", markup=False)
        return
    for file, tap_id in known.items():
        notes.print(f"{file.name}: stored already as {tap_id}", markup=False)
