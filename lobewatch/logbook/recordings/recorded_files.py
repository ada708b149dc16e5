"""Find recorded files and read each as a tap test of a machine."""

import glob
import io
import re
import tempfile
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple, Self

import acquisition
from acquisition import (
    Circumstances,
    DataError,
    Description,
    Fact,
    HitDecision,
    Recording,
    SourceFile,
    TapTest,
    inspect_file,
)
from acquisition.errors import join_sentences
from acquisition.files.contents.contents import Origin, format_window
from acquisition.files.readers.text_file import is_prose
from acquisition.files.tap_file import read_judged_tap
from acquisition.hit_quality.decide_hits import add_decisions, decide_hits
from lobewatch.machine import Machine, MachineFolder
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.measurement.clock_questions import is_in_future

DATE_REQUEST = 'Give the recording date with Description.date 2024-05-01 or Description.date_pattern "%Y%m%d"'
CHANGING_FILE_TEXT = "file changed while it was read. Wait until the file is completely written."
"""Error of a file that another program still writes."""
_UNIX_SYSTEM = 3
"""System of the entries in an archive, the same on every computer (PKWARE APPNOTE 4.4.2)."""
_DATE_PART_PATTERNS = {
    "%Y": r"\d{4}",
    "%y": r"\d{2}",
    **dict.fromkeys(("%m", "%d", "%H", "%M", "%S"), r"\d{1,2}"),
    "%b": r"[^\W\d]{3,4}",
    "%B": r"[^\W\d]+",
    "%j": r"\d{3}",
    "%%": "%",
}
"""Regular expression of each directive of a date pattern."""
_FIXED_WIDTH_PATTERNS = {part: pattern.replace("{1,2}", "{2}") for part, pattern in _DATE_PART_PATTERNS.items()}
"""Regular expressions with all digits."""


def read_tap_bytes(content: bytes) -> TapTest:
    """Read the content of a tap file. DataError if it is damaged."""
    with tempfile.TemporaryDirectory(prefix="lobewatch-") as folder:
        path = Path(folder) / "tap.h5"
        path.write_bytes(content)
        return acquisition.read_tap(path)


def find_recordings(places: Sequence[Path | str], *, repeated: bool = False) -> tuple[list[Path], list[Path]]:
    """Find recorded files by path, folder or pattern, those of a folder or pattern in the order of their numbers.

    Returns each file once unless `repeated`, and the files that were passed over: those in a folder with an extension
    of no known format, and texts without a row of numbers. A file named by its path is always taken. DataError for a
    folder or pattern without any recorded file.
    """
    files, passed_over = list[Path](), list[Path]()
    for place in places:
        path = Path(place)
        if path.is_dir():
            recordings, others = _find_in_folder(path)
            files += recordings
            passed_over += others
        elif path.exists() or not glob.has_magic(str(place)):
            files.append(path)
        else:
            files += _find_matching(str(place))
    return files if repeated else list(dict.fromkeys(files)), passed_over


def _find_in_folder(folder: Path) -> tuple[list[Path], list[Path]]:
    """Find the recordings in a folder, and the other files that are not hidden."""
    paths = [path for path in folder.rglob("*") if path.is_file()]
    shown = (path for path in paths if not any(part.startswith(".") for part in path.relative_to(folder).parts))
    files = _sort_by_number(shown)
    extensions = {extension for file_format in acquisition.list_formats() for extension in file_format.extensions}
    recordings = [file for file in files if file.suffix.lower() in extensions and not is_prose(file)]
    if not recordings:
        kinds = ", ".join(sorted(extensions))
        raise DataError(f"{folder}: no recording among {len(files)} files. Supported file types: {kinds}.")
    found = set(recordings)
    return recordings, [file for file in files if file not in found]


def _find_matching(pattern: str) -> list[Path]:
    names = glob.glob(pattern, recursive=True)  # noqa: PTH207 - pathlib takes no absolute pattern
    files = _sort_by_number(path for path in map(Path, names) if path.is_file())
    if not files:
        raise DataError(f"{pattern}: no file matches this pattern")
    return files


def _sort_by_number(paths: Iterable[Path]) -> list[Path]:
    """Sort paths with their numbers as numbers: hit_2 before hit_10."""
    return sorted(sorted(paths), key=lambda path: [*map(_split_numbers, path.parts)])


def _split_numbers(name: str) -> list[str | int]:
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", name)]


def read_source(file: Path, description: Description) -> bytes:
    """Return the content of a recorded file; of several files of one tap test a ZIP archive.

    The bytes of the archive do not depend on the order of the files.
    """
    if not description.hit_files:
        return file.read_bytes()
    files = {(path.name, path.read_bytes()) for path in (file, *description.hit_files)}
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w") as archive:
        by_name = sorted(files, key=lambda named: (_split_numbers(named[0]), named))
        for number, (name, content) in enumerate(by_name, 1):
            entry = zipfile.ZipInfo(f"{number}/{name}")
            entry.create_system = _UNIX_SYSTEM
            archive.writestr(entry, content)
    return memory.getvalue()


class MachineContext(NamedTuple):
    """Machine of a recording."""

    machine: Machine
    """Settings in machine.toml."""
    toml: str
    """Content of machine.toml; the tap test keeps a copy."""

    @classmethod
    def of(cls, folder: MachineFolder) -> Self:
        """Read the present settings of a machine."""
        return cls(folder.machine, folder.toml_text)


@lru_cache(maxsize=4)
def parse_context(machine_toml: str) -> MachineContext:
    """Parse the content of machine.toml."""
    return MachineContext(parse_machine_file(machine_toml), machine_toml)


def read_tap_test(
    context: MachineContext, file: Path, description: Description, content: bytes, at: Path
) -> tuple[TapTest, Recording]:
    """Read a recorded file as a tap test. DataError with everything that is missing or wrong.

    `content` is kept with the tap test, unless the tap test holds all of it already. `at` is the path where the content
    can be read.
    """
    before = at.stat()
    recording = inspect_file(at, replace(description, without_force=context.machine.tap.hammer == "none"))
    after, is_joined = at.stat(), bool(description.hit_files)
    is_changed = (before.st_size, before.st_mtime_ns) != (after.st_size, after.st_mtime_ns)
    if is_changed or (read_source(at, description) != content if is_joined else after.st_size != len(content)):
        raise DataError(f"{file}: {CHANGING_FILE_TEXT}")
    created = _find_date(file, description, recording.created)
    if created is None:
        raise DataError(f"{file}: {join_sentences(recording.problems or 'no recording date', DATE_REQUEST)}")
    _reject_windowed(recording.require_measurable())
    about = _build_circumstances(context, recording, description, check_time(file, created))
    recording = replace(recording, facts=(*recording.facts, *_label_facts(about, description, recording)))
    source = SourceFile(f"{file.stem} and {len(description.hit_files)} more.zip" if is_joined else file.name, content)
    tap = TapTest(acquisition.new_tap_id(about), about, recording.frf, recording.hits)
    if not is_joined and (judged := read_judged_tap(at)) is not None:
        is_live = judged.source is None and len(judged.hits) == len(recording.hits)
        source = source.without_content if is_live else source
        tap, recording = replace(judged, id=tap.id, circumstances=about), replace(recording, hits=judged.hits)
    return _evaluate_tap_test(replace(tap, source=source), recording.path, description.hit_decisions), recording


def _reject_windowed(recording: Recording) -> None:
    """Reject a window: a tap test does not store it, so its damping would count as that of the spindle."""
    if recording.window is not None:
        text = f"the response has a window ({format_window(recording.window)}), which adds damping"
        cure = "Export the response without a window, or correct an exponential window with fit_file_modes."
        raise DataError(f"{recording.path}: {text}. {cure}")


def _find_date(file: Path, description: Description, in_file: datetime | None) -> datetime | None:
    if not description.date_pattern:
        return description.date or in_file
    if description.date is not None:
        raise ValueError("Description.date and Description.date_pattern are both given. Leave out one of the two.")
    return parse_date_in_name(file, description.date_pattern)


def _build_circumstances(
    context: MachineContext, recording: Recording, description: Description, created: datetime
) -> Circumstances:
    try:
        direction = acquisition.parse_direction(description.direction or recording.direction or "x")
    except ValueError as error:
        if description.direction:
            raise
        raise DataError(
            f"{recording.path}: {join_sentences(str(error), 'Give it with Description.direction')}"
        ) from error
    machine = context.machine
    tool = description.tool or recording.tool or machine.tap.tool
    conditions = machine.tap.conditions(tool) if recording.conditions is None else recording.conditions
    return Circumstances(
        machine=machine.machine.name,
        created=created,
        tool=tool,
        direction=direction,
        operator=recording.operator,
        machine_toml=context.toml,
        device=recording.device,
        conditions=description.conditions.with_defaults(conditions),
    )


def _label_facts(about: Circumstances, description: Description, recording: Recording) -> list[Fact]:
    by_option = bool(description.date or description.date_pattern)
    date = Fact("date", f"{about.created:%Y-%m-%d %H:%M}", "option" if by_option else "file")
    names = ("tool", "direction")
    return [date, *(Fact(name, getattr(about, name), _find_origin(name, description, recording)) for name in names)]


def _find_origin(name: str, description: Description, recording: Recording) -> Origin:
    return "option" if getattr(description, name) else "file" if getattr(recording, name) else "default"


def _evaluate_tap_test(tap: TapTest, path: Path, decisions: Sequence[HitDecision]) -> TapTest:
    """Return a tap test with verdicts on its hits, the decisions, and the FRF of the hits that remain."""
    try:
        if decisions:
            tap = tap if tap.flags else replace(tap, flags=tuple(map(acquisition.check_hit, tap.hits)))
            return decide_hits(tap, add_decisions(tap.flags, tap.decisions, decisions))
        if tap.flags or tap.frf is not None:
            return tap
        frf, flags = acquisition.average_good_hits(tap.hits)
    except ValueError as error:
        raise DataError(f"{path}: {error}") from error
    return replace(tap, frf=frf, flags=flags)


def parse_date_in_name(file: Path, pattern: str) -> datetime:
    """Parse the date in the name of a file (local time), or in its path if the pattern has a "/".

    ValueError if there is no such date, or if the pattern has no year, month or day.
    """
    directives = re.findall(r"%.", pattern)
    unknown = [directive for directive in directives if directive not in _DATE_PART_PATTERNS]
    if unknown or not directives:
        names = ", ".join(_DATE_PART_PATTERNS)
        raise ValueError(f"Description.date_pattern {pattern!r} is invalid. Use {names}, such as %Y%m%d.")
    text = file.absolute().as_posix() if "/" in pattern else file.name
    for parts in (_FIXED_WIDTH_PATTERNS, _DATE_PART_PATTERNS):
        pieces = (parts.get(piece, re.escape(piece)) for piece in re.split(r"(%.)", pattern))
        for match in re.finditer(rf"(?<!\d){''.join(pieces)}(?!\d)", text):
            try:
                return datetime.strptime(match[0], pattern).astimezone()
            except (ValueError, OverflowError, OSError):
                continue
    finding = f"no date matches Description.date_pattern {pattern!r} in {text!r}"
    raise ValueError(f"{file}: {finding}. Correct the pattern, or give Description.date.")


def check_time(file: Path, time: datetime) -> datetime:
    """Return a time with its zone. ValueError for a time in the future or out of the range of UTC."""
    try:
        created = time.astimezone()
    except (OverflowError, ValueError, OSError) as error:
        raise ValueError(
            f"{file}: recording date {time} is out of range. Give the date with Description.date."
        ) from error
    if is_in_future(created, datetime.now(UTC)):
        cure = "Give the date with Description.date, or correct the computer clock."
        raise ValueError(f"{file}: recording date {created:%Y-%m-%d} is in the future. {cure}")
    return created
