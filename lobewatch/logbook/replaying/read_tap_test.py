"""One recorded file as a tap test of a machine."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime
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
from lobewatch.machine import Machine, MachineFolder
from lobewatch.measuring.clock import is_ahead

ASK_DATE = 'when it was recorded (--date 2024-05-01, or --date-pattern "%Y%m%d" for a date in its name)'
_ASK = "it does not say: "
_PARTS = {"%Y": r"\d{4}", "%y": r"\d{2}", "%m": r"\d{1,2}", "%d": r"\d{1,2}", "%H": r"\d{1,2}", "%M": r"\d{1,2}"}
_PARTS |= {"%S": r"\d{1,2}", "%b": r"[^\W\d]{3,4}", "%B": r"[^\W\d]+", "%j": r"\d{3}", "%%": "%"}
"""Patterns of the parts of a date."""
_FIXED = {part: re.sub(r"\{1,2\}", "{2}", pattern) for part, pattern in _PARTS.items()}
"""Patterns with all digits."""


class Setup(NamedTuple):
    """The machine that a recording is of."""

    machine: Machine
    """Tables of machine.toml as they were read."""
    toml: str
    """The text of its machine.toml, a copy of which becomes a part of the tap test."""

    @classmethod
    def of(cls, folder: MachineFolder) -> Self:
        """As it is now."""
        return cls(folder.machine, folder.toml_text)


def read_tap_test(
    setup: Setup, file: Path, description: Description, content: bytes, at: Path | None = None
) -> tuple[TapTest, Recording]:
    """A file as a tap test, and how it was understood; DataError with all that is missing or wrong in it.

    content: its bytes, which become a part of the tap test where that does not hold all of it anyway; at: where these
    lie, if not at `file`.
    """
    at = file if at is None else at
    before = at.stat()
    recording = look(at, replace(description, without_force=setup.machine.tap.hammer == "none"))
    after = at.stat()
    if (before.st_size, before.st_mtime_ns) != (after.st_size, after.st_mtime_ns) or after.st_size != len(content):
        raise DataError(f"{file}: it changes while it is read; wait until it is written")
    created = _created(file, description, recording.created)
    if created is None:
        glue = ", " if _ASK in recording.complaint else f"; {_ASK}" if recording.complaint else _ASK
        raise DataError(f"{file}: {recording.complaint}{glue}{ASK_DATE}")
    _refuse_window(recording.checked())
    about = _about(setup, recording, description, checked_time(file, created))
    recording = replace(recording, facts=(*recording.facts, *_labels(about, description, recording)))
    source = SourceFile(file.name, content)
    return _tap_test(recording, about, source.without_content if is_all_in(at, recording.hits) else source), recording


def _refuse_window(recording: Recording) -> None:
    """A tap test keeps no window, and its damping would pass for that of the spindle."""
    if recording.window is not None:
        raise DataError(
            f"{recording.path}: the response is under a window ({window_text(recording.window)}), which adds damping; "
            "export it without; lobewatch modes takes an exponential one off"
        )


def _created(file: Path, description: Description, in_file: datetime | None) -> datetime | None:
    if description.date is not None and description.date_pattern:
        raise ValueError("--date and --date-pattern: give one of them")
    return date_in_name(file, description.date_pattern) if description.date_pattern else description.date or in_file


def _about(setup: Setup, recording: Recording, description: Description, created: datetime) -> Circumstances:
    try:
        direction = tap_direction(description.direction or recording.direction or "x")
    except ValueError as error:
        if description.direction:
            raise
        raise DataError(f"{recording.path}: its {error} (--direction)") from error
    machine, tool = setup.machine, description.tool or recording.tool or setup.machine.tap.tool
    conditions = machine.tap.conditions(tool) if recording.conditions is None else recording.conditions
    return Circumstances(
        machine=machine.machine.name,
        created=created,
        tool=tool,
        direction=direction,
        operator=recording.operator,
        machine_toml=setup.toml,
        device=recording.device,
        conditions=description.conditions.over(conditions),
    )


def _labels(about: Circumstances, description: Description, recording: Recording) -> list[Fact]:
    by_option = bool(description.date or description.date_pattern)
    return [
        Fact("date", f"{about.created:%Y-%m-%d %H:%M}", "option" if by_option else "file"),
        Fact("tool", about.tool, "option" if description.tool else "file" if recording.tool else "default"),
        Fact(
            "direction",
            about.direction,
            "option" if description.direction else "file" if recording.direction else "default",
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


def date_in_name(file: Path, pattern: str) -> datetime:
    """The date that stands in a file's name, or in its path where the pattern has a "/"; of local time.

    ValueError where it stands there not at all, or the pattern holds no year, month or day.
    """
    directives = re.findall(r"%.", pattern)
    unknown = [directive for directive in directives if directive not in _PARTS]
    if unknown or not directives:
        raise ValueError(f"--date-pattern {pattern!r}: give it with {', '.join(_PARTS)}, such as %Y%m%d")
    text = file.absolute().as_posix() if "/" in pattern else file.name
    for parts in (_FIXED, _PARTS):
        pieces = (parts.get(piece, re.escape(piece)) for piece in re.split(r"(%.)", pattern))
        for match in re.finditer(rf"(?<!\d){''.join(pieces)}(?!\d)", text):
            try:
                return datetime.strptime(match[0], pattern).astimezone()
            except (ValueError, OverflowError, OSError):
                continue
    raise ValueError(f"{file}: no date like --date-pattern {pattern!r} in {text!r}")


def checked_time(file: Path, time: datetime) -> datetime:
    """With its zone; ValueError for a time in the future, or one that no calendar of UTC has."""
    try:
        created = time.astimezone()
    except (OverflowError, ValueError, OSError) as error:
        raise ValueError(f"{file}: recorded on {time}: out of range; give --date from year 2 on") from error
    if is_ahead(created, datetime.now(UTC)):
        raise ValueError(
            f"{file}: recorded on {created:%Y-%m-%d}, in the future; give the day with --date, or set the clock right"
        )
    return created
