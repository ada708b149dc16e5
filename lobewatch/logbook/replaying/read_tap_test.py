"""One recorded file as a tap test of a machine."""

from __future__ import annotations

from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import NamedTuple, Self

from acquisition import (
    Circumstances,
    DataError,
    Description,
    Fact,
    Recording,
    SourceFile,
    TapTest,
    average_good,
    look,
    new_tap_id,
    tap_direction,
)
from acquisition.files.contents.exponential import window_text
from acquisition.files.tap_recording import is_all_in
from lobewatch.logbook.replaying.dating import checked_time, date_in_name
from lobewatch.machine import Machine, MachineFolder

ASK_DATE = 'when it was recorded (--date 2024-05-01, or --date-pattern "%Y%m%d" for a date in its name)'
_ASK = "it does not say: "


class Setup(NamedTuple):
    """The machine that a recording is of."""

    machine: Machine
    """As it was read."""
    toml: str
    """The text of its machine.toml, a copy of which becomes a part of the tap test."""

    @classmethod
    def of(cls, folder: MachineFolder) -> Self:
        """As it is now."""
        return cls(folder.machine, folder.toml.read_text("utf-8"))


def read_tap_test(
    setup: Setup, file: Path, said: Description, content: bytes, at: Path | None = None
) -> tuple[TapTest, Recording]:
    """A file as a tap test, and how it was understood; DataError with all that is missing or wrong in it.

    content: its bytes, which become a part of the tap test where that does not hold all of it anyway; at: where these
    lie, if not at `file`.
    """
    at = file if at is None else at
    before = at.stat()
    recording = look(at, said)
    after = at.stat()
    if (before.st_size, before.st_mtime_ns) != (after.st_size, after.st_mtime_ns) or after.st_size != len(content):
        raise DataError(f"{file}: it changes while it is read; wait until it is written")
    created = _created(file, said, recording.created)
    if created is None:
        glue = ", " if _ASK in recording.complaint else f"; {_ASK}" if recording.complaint else _ASK
        raise DataError(f"{file}: {recording.complaint}{glue}{ASK_DATE}")
    _refuse_window(recording.checked())
    about = _about(setup, recording, said, checked_time(file, created))
    recording = replace(recording, facts=(*recording.facts, *_labels(about, said, recording)))
    source = SourceFile(file.name, content)
    return _tap_test(recording, about, source.without_content if is_all_in(at, recording.hits) else source), recording


def _refuse_window(recording: Recording) -> None:
    """A tap test keeps no window, and its damping would pass for that of the spindle."""
    if recording.window is not None:
        raise DataError(
            f"{recording.path}: the response is under a window ({window_text(recording.window)}), which adds damping; "
            "export it without; lobewatch modes takes an exponential one off"
        )


def _created(file: Path, said: Description, in_file: datetime | None) -> datetime | None:
    if said.date is not None and said.date_pattern:
        raise ValueError("--date and --date-pattern: give one of them")
    return date_in_name(file, said.date_pattern) if said.date_pattern else said.date or in_file


def _about(setup: Setup, recording: Recording, said: Description, created: datetime) -> Circumstances:
    try:
        direction = tap_direction(said.direction or recording.direction or "x")
    except ValueError as error:
        if said.direction:
            raise
        raise DataError(f"{recording.path}: its {error} (--direction)") from error
    machine, tool = setup.machine, said.tool or recording.tool or setup.machine.tap.tool
    conditions = machine.tap.conditions(tool) if recording.conditions is None else recording.conditions
    return Circumstances(
        machine=machine.machine.name,
        created=created,
        tool=tool,
        direction=direction,
        operator=recording.operator,
        machine_toml=setup.toml,
        device=recording.device,
        conditions=said.conditions.over(conditions),
    )


def _labels(about: Circumstances, said: Description, recording: Recording) -> list[Fact]:
    by_option = bool(said.date or said.date_pattern)
    return [
        Fact("date", f"{about.created:%Y-%m-%d %H:%M}", "option" if by_option else "file"),
        Fact("tool", about.tool, "option" if said.tool else "file" if recording.tool else "default"),
        Fact(
            "direction", about.direction, "option" if said.direction else "file" if recording.direction else "default"
        ),
    ]


def _tap_test(recording: Recording, about: Circumstances, source: SourceFile) -> TapTest:
    if recording.frf is not None:
        return TapTest(new_tap_id(about), about, recording.frf, source=source)
    try:
        frf, flags = average_good(recording.hits)
    except DataError as error:
        raise DataError(f"{recording.path}: {error}") from error
    return TapTest(new_tap_id(about), about, frf, recording.hits, flags, source)
