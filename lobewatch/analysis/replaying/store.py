"""Recorded files stored as tap tests of a machine, each once."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from acquisition import DataError, Description, TapTest
from lobewatch.analysis.replaying.read_tap_test import read_tap_test
from lobewatch.machine import MachineFolder, TapEntry

Progress = Callable[[str, int, int], None]
"""Told what is done ("read", "store"), how many of it are, and of how many."""


@dataclass(frozen=True)
class Stored:
    """What came of some recorded files."""

    tap_ids: Sequence[str]
    """The tap test of each file that was not refused, in the order of the files."""
    known: Mapping[Path, str]
    """Files that were stored already, or stand twice among those given, and their tap test."""
    fresh: Sequence[str]
    """The tap tests that are new, oldest first."""
    refused: Mapping[Path, str] = field(default_factory=dict)
    """Files that cannot be used, and why."""
    taken: Sequence[str] = ()
    """What was taken for granted where files do not say it, each once."""


@dataclass
class KnownContents:
    """Which contents are stored already, and as which tap test."""

    by_digest: dict[str, list[tuple[str, str]]]
    """SHA-256 -> identities of tap tests and their directions."""

    @classmethod
    def of(cls, taps: Sequence[TapEntry]) -> KnownContents:
        """Those of committed tap tests, by their file and by the file that they were replayed from."""
        found = cls({})
        for tap in taps:
            for digest in filter(None, (tap.source_sha256, tap.sha256)):
                found.by_digest.setdefault(digest, []).append((tap.id, tap.direction))
        return found

    def tap_of(self, digest: str, said: Description) -> str | None:
        """The tap test of a content; one of several responses is known only where it is stored in this direction."""
        for tap_id, direction in self.by_digest.get(digest, ()):
            if said.response is None or direction == (said.direction or direction):
                return tap_id
        return None

    def add(self, digest: str, tap: TapTest) -> None:
        """A tap test that is going to be stored."""
        self.by_digest.setdefault(digest, []).append((tap.id, tap.circumstances.direction))


def store_recordings(
    folder: MachineFolder,
    files: Sequence[Path],
    said: Description,
    *,
    keep_going: bool = False,
    progress: Progress = lambda _what, _done, _of: None,
) -> Stored:
    """Commit recorded files, each once, oldest first; all are read and judged before the first one is stored.

    DataError, and nothing is stored, where one cannot be used, with all of these; keep_going: the others are stored.
    """
    contents = KnownContents.of(folder.taps())
    tap_ids, known, fresh, refused = list[str](), dict[Path, str](), list[TapTest](), dict[Path, str]()
    taken = dict[str, None]()
    for number, file in enumerate(files, 1):
        try:
            content = file.read_bytes()
            digest = hashlib.sha256(content).hexdigest()
            stored = contents.tap_of(digest, said)
            if stored is None:
                tap, recording = read_tap_test(folder, file, said, content)
                fresh.append(tap)
                told = (fact for fact in recording.facts if fact.origin == "default")
                taken |= dict.fromkeys(f"{fact.name} {fact.value}" for fact in told)
                contents.add(digest, tap)
            else:
                known[file] = stored
            tap_ids.append(stored or fresh[-1].id)
        except (DataError, OSError, ValueError) as error:
            if len(files) == 1:
                raise
            refused[file] = reason_of(file, error)
        progress("read", number, len(files))
    if refused and not (keep_going and tap_ids):
        raise DataError(refusal(refused, len(files)))
    fresh.sort(key=lambda tap: tap.circumstances.created)
    for number, tap in enumerate(fresh, 1):
        folder.commit(tap)
        progress("store", number, len(fresh))
    return Stored(tap_ids, known, [tap.id for tap in fresh], refused, list(taken))


def reason_of(file: Path, error: Exception) -> str:
    """An error about a file, without its name."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return str(error).removeprefix(f"{file}: ")


def refusal(refused: Mapping[Path, str], n: int, *, stored: bool = False) -> str:
    """All files that cannot be used, and what can be done; stored: the others are."""
    lines = [f"{file}: {why}" for file, why in refused.items()]
    if len(refused) == n:
        return "\n".join([f"none of the {n} files can be used; nothing is stored", *lines])
    others = "the others are stored" if stored else "nothing is stored; --keep-going stores the others"
    if len(lines) == 1:
        return f"{lines[0]} (1 of {n} files; {others})"
    return "\n".join([f"{len(refused)} of {n} files cannot be used; {others}", *lines])
