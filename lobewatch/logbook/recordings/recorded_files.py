"""Find recorded files and read each as a tap test of a machine."""

from __future__ import annotations

import glob
import re
from collections.abc import Sequence
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
    average_good_hits,
    inspect_file,
    list_formats,
    new_tap_id,
    parse_direction,
)
from acquisition.files.contents.contents import format_window
from acquisition.files.readers.text_file import is_prose
from acquisition.files.tap_file import has_all_hits
from lobewatch.machine import Machine, MachineFolder
from lobewatch.measurement.clock_questions import is_in_future


def find_recordings(places: Sequence[Path | str]) -> tuple[list[Path], list[Path]]:
    """Each file once, those of a folder and all below it by name, and those of folders that are passed over.

    Passed over is what lies in a folder and has an extension that no known format has, or is a text without a row of
    numbers; what is named is taken.
    DataError for a folder or a pattern without any file; a name is taken as it is, whether or not it is there.
    """
    files, passed_over = dict[Path, None](), list[Path]()
    for place in places:
        path = Path(place)
        if path.is_dir():
            taken, left = _find_in_folder(path)
            files |= dict.fromkeys(taken)
            passed_over += left
        elif path.exists() or not glob.has_magic(str(place)):
            files[path] = None
        else:
            files |= dict.fromkeys(_find_matching(str(place)))
    return list(files), passed_over


def _find_in_folder(folder: Path) -> tuple[list[Path], list[Path]]:
    files = sorted(file for file in folder.rglob("*") if file.is_file() and not _is_hidden(file.relative_to(folder)))
    extensions = {extension for file_format in list_formats() for extension in file_format.extensions}
    taken = [file for file in files if file.suffix.lower() in extensions and not is_prose(file)]
    if not taken:
        kinds = ", ".join(sorted(extensions))
        raise DataError(f"{folder}: none of the {len(files)} files in this folder is a recording (looked for {kinds})")
    left = set(files).difference(taken)
    return taken, [file for file in files if file in left]


def _is_hidden(path: Path) -> bool:
    return any(part.startswith(".") for part in path.parts)


def _find_matching(pattern: str) -> list[Path]:
    names = glob.glob(pattern, recursive=True)  # noqa: PTH207 - that of pathlib takes no absolute pattern
    files = sorted(path for path in map(Path, names) if path.is_file())
    if not files:
        raise DataError(f"{pattern}: no file matches this pattern")
    return files


DATE_REQUEST = 'when it was recorded (--date 2024-05-01, or --date-pattern "%Y%m%d" for a date in its name)'
_MISSING_PREFIX = "it does not say: "
_DATE_PART_PATTERNS = {
    "%Y": r"\d{4}",
    "%y": r"\d{2}",
    "%m": r"\d{1,2}",
    "%d": r"\d{1,2}",
    "%H": r"\d{1,2}",
    "%M": r"\d{1,2}",
}
_DATE_PART_PATTERNS |= {"%S": r"\d{1,2}", "%b": r"[^\W\d]{3,4}", "%B": r"[^\W\d]+", "%j": r"\d{3}", "%%": "%"}
"""Patterns of the parts of a date."""
_FIXED_WIDTH_PATTERNS = {part: re.sub(r"\{1,2\}", "{2}", pattern) for part, pattern in _DATE_PART_PATTERNS.items()}
"""Patterns with all digits."""


class MachineContext(NamedTuple):
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
    setup: MachineContext, file: Path, description: Description, content: bytes, at: Path | None = None
) -> tuple[TapTest, Recording]:
    """A file as a tap test, and how it was understood; DataError with all that is missing or wrong in it.

    content: its bytes, which become a part of the tap test where that does not hold all of it anyway; at: where these
    lie, if not at `file`.
    """
    at = file if at is None else at
    before = at.stat()
    recording = inspect_file(at, replace(description, without_force=setup.machine.tap.hammer == "none"))
    after = at.stat()
    if (before.st_size, before.st_mtime_ns) != (after.st_size, after.st_mtime_ns) or after.st_size != len(content):
        raise DataError(f"{file}: it changes while it is read; wait until it is written")
    created = _find_date(file, description, recording.created)
    if created is None:
        glue = (
            ", "
            if _MISSING_PREFIX in recording.problems
            else f"; {_MISSING_PREFIX}"
            if recording.problems
            else _MISSING_PREFIX
        )
        raise DataError(f"{file}: {recording.problems}{glue}{DATE_REQUEST}")
    _reject_windowed(recording.require_valid())
    about = _build_circumstances(setup, recording, description, check_time(file, created))
    recording = replace(recording, facts=(*recording.facts, *_label_facts(about, description, recording)))
    source = SourceFile(file.name, content)
    return _build_tap_test(
        recording, about, source.without_content if has_all_hits(at, recording.hits) else source
    ), recording


def _reject_windowed(recording: Recording) -> None:
    """A tap test keeps no window, and its damping would pass for that of the spindle."""
    if recording.window is not None:
        raise DataError(
            f"{recording.path}: the response is under a window ({format_window(recording.window)}), which adds damping; "
            "export it without; lobewatch modes takes an exponential one off"
        )


def _find_date(file: Path, description: Description, in_file: datetime | None) -> datetime | None:
    if description.date is not None and description.date_pattern:
        raise ValueError("--date and --date-pattern: give one of them")
    return (
        parse_date_in_name(file, description.date_pattern) if description.date_pattern else description.date or in_file
    )


def _build_circumstances(
    setup: MachineContext, recording: Recording, description: Description, created: datetime
) -> Circumstances:
    try:
        direction = parse_direction(description.direction or recording.direction or "x")
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
        conditions=description.conditions.with_defaults(conditions),
    )


def _label_facts(about: Circumstances, description: Description, recording: Recording) -> list[Fact]:
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


def _build_tap_test(recording: Recording, about: Circumstances, source: SourceFile) -> TapTest:
    if recording.frf is not None:
        return TapTest(new_tap_id(about), about, recording.frf, source=source)
    try:
        frf, flags = average_good_hits(recording.hits)
    except DataError as error:
        raise DataError(f"{recording.path}: {error}") from error
    return TapTest(new_tap_id(about), about, frf, recording.hits, flags, source)


def parse_date_in_name(file: Path, pattern: str) -> datetime:
    """The date that stands in a file's name, or in its path where the pattern has a "/"; of local time.

    ValueError where it stands there not at all, or the pattern holds no year, month or day.
    """
    directives = re.findall(r"%.", pattern)
    unknown = [directive for directive in directives if directive not in _DATE_PART_PATTERNS]
    if unknown or not directives:
        raise ValueError(f"--date-pattern {pattern!r}: give it with {', '.join(_DATE_PART_PATTERNS)}, such as %Y%m%d")
    text = file.absolute().as_posix() if "/" in pattern else file.name
    for parts in (_FIXED_WIDTH_PATTERNS, _DATE_PART_PATTERNS):
        pieces = (parts.get(piece, re.escape(piece)) for piece in re.split(r"(%.)", pattern))
        for match in re.finditer(rf"(?<!\d){''.join(pieces)}(?!\d)", text):
            try:
                return datetime.strptime(match[0], pattern).astimezone()
            except (ValueError, OverflowError, OSError):
                continue
    raise ValueError(f"{file}: no date like --date-pattern {pattern!r} in {text!r}")


def check_time(file: Path, time: datetime) -> datetime:
    """With its zone; ValueError for a time in the future, or one that no calendar of UTC has."""
    try:
        created = time.astimezone()
    except (OverflowError, ValueError, OSError) as error:
        raise ValueError(f"{file}: recorded on {time}: out of range; give --date from year 2 on") from error
    if is_in_future(created, datetime.now(UTC)):
        raise ValueError(
            f"{file}: recorded on {created:%Y-%m-%d}, in the future; give the day with --date, or set the clock right"
        )
    return created
