"""Recorded files as tap tests of a machine."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from acquisition import (
    Circumstances,
    Conditions,
    DataError,
    Frf,
    SourceFile,
    TapTest,
    average_good,
    new_tap_id,
    read_recording,
    recorded_as,
    tap_direction,
)
from lobewatch.analysis.questions.clock import is_ahead
from lobewatch.machine import MachineFolder


@dataclass(frozen=True)
class Stored:
    """What came of some recorded files."""

    tap_ids: Sequence[str]
    """The tap test of each file, in the order of the files."""
    known: Mapping[Path, str]
    """Files that were stored already, or stand twice among those given, and their tap test."""
    fresh: Sequence[str]
    """The tap tests that are new."""


def store_recordings(
    folder: MachineFolder,
    files: Sequence[Path],
    date: datetime | None,
    tool: str,
    direction: str,
    conditions: Conditions,
) -> Stored:
    """Commit recorded files, each once; all are read and judged before the first one is stored.

    What conditions leave open, a tap file says itself, and machine.toml of any other file.
    """
    stored = {digest: tap.id for tap in folder.taps() for digest in (tap.source_sha256, tap.sha256)}
    tap_ids, known, fresh = list[str](), dict[Path, str](), list[TapTest]()
    for file in files:
        content = file.read_bytes()
        digest = hashlib.sha256(content).hexdigest()
        if digest in stored:
            known[file] = stored[digest]
        else:
            about = _circumstances(folder, file, date, tool, direction)
            about = replace(about, conditions=conditions.over(about.conditions))
            fresh.append(_tap_test(file, about, SourceFile(file.name, content)))
            stored[digest] = fresh[-1].id
        tap_ids.append(stored[digest])
    for recorded in fresh:
        folder.commit(recorded)
    return Stored(tap_ids, known, [recorded.id for recorded in fresh])


def _circumstances(
    folder: MachineFolder, file: Path, date: datetime | None, tool: str, direction: str
) -> Circumstances:
    own, setup = recorded_as(file), folder.machine
    created, tool = _time_of(file, date, own.created), tool or own.tool or setup.tap.tool
    return replace(
        own,
        machine=setup.machine.name,
        created=created,
        tool=tool,
        direction=tap_direction(direction or own.direction),
        machine_toml=folder.toml.read_text("utf-8"),
        conditions=own.conditions if own.machine else setup.tap.conditions(tool),
    )


def _time_of(file: Path, date: datetime | None, own: datetime) -> datetime:
    """When it was recorded; ValueError for a time in the future, or one that no calendar of UTC has."""
    try:
        created = (date or own).astimezone()
    except (OverflowError, ValueError, OSError) as error:
        raise ValueError(f"{file}: recorded on {date or own}: out of range; give --date from year 2 on") from error
    if is_ahead(created, datetime.now(UTC)):
        raise ValueError(
            f"{file}: recorded on {created:%Y-%m-%d}, in the future; give the day with --date, or set the clock right"
        )
    return created


def _tap_test(file: Path, about: Circumstances, source: SourceFile) -> TapTest:
    recording = read_recording(file)
    if isinstance(recording, Frf):
        return TapTest(new_tap_id(about), about, recording, source=source)
    try:
        frf, flags = average_good(recording)
    except DataError as error:
        raise DataError(f"{file}: {error}") from error
    return TapTest(new_tap_id(about), about, frf, tuple(recording), flags, source)
