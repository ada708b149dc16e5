"""Summarize the status of one machine and keep the summary in standing.json."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from datetime import datetime, timedelta
from functools import cache, cached_property
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import msgspec

from acquisition import Remark
from acquisition.file_io import MAX_SETTINGS_FILE_SIZE, atomic_write, read_regular_file
from lobewatch.machine.folder_files import compute_change_mark
from lobewatch.monitoring.alarm import Alarm, add_acknowledgements
from lobewatch.monitoring.status_rules import (
    UNREADABLE_NEXT_STEP,
    StatusLevel,
    add_damage_remarks,
    count_days_left,
    date_remarks,
    find_next_step,
    is_early_alarm,
    sort_by_severity,
    unreadable_remark,
    worst_status,
)
from lobewatch.monitoring.threshold_dates import LimitForecasts, ProgramForecast


class SeriesSummary(msgspec.Struct, frozen=True):
    """The summary of one tool in one direction."""

    name: str
    """Tool and direction, in words."""
    tool: str
    """Tool in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    drop: float | None
    """Fall of the frequency from the start of the series (%); None where it is not known."""
    drop_std: float | None
    """Standard error of the fall (%); None where it is not known."""
    frequency: float | None
    """Natural frequency of the newest point (Hz); None where no test can be compared with."""
    alarm: str = ""
    """"step" or "slope" where the watch over the series is on alarm."""
    scatter: tuple[float, float] = (0.0, 0.0)
    """Scatter of its points (%), and the degrees of freedom that it is known with; 0: not known."""
    common_scatter: tuple[float, float] = (0.0, 0.0)
    """The same of the mean of both directions, where the other one was tapped in the same clampings."""
    points: tuple[tuple[float, float], ...] = ()
    """Day since 1970 and change from the start (%), thinned out."""


class DatedStatus(NamedTuple):
    """The standing of a machine at a time."""

    status: StatusLevel
    """Light of the worst reason."""
    remarks: tuple[Remark, ...]
    """Reasons, in order of harm."""
    next_step: str
    """Next step, one sentence."""
    days_left: float | None
    """Days until the next test is due; negative where it is overdue; None before the first."""
    time: datetime
    """Time that it is the standing at."""

    @property
    def is_early(self) -> bool:
        """Whether its alarm is that of a fall short of every limit."""
        return is_early_alarm(self.remarks)

    @property
    def is_readable(self) -> bool:
        """Whether anything can be said of the machine, be it that it was never tapped."""
        return all(remark.code != "unreadable" for remark in self.remarks)


class MachineSummary(msgspec.Struct, frozen=True, dict=True):
    """The standing of a machine, without what the date of today adds."""

    name: str
    """Name of the machine in machine.toml."""
    remarks: tuple[Remark, ...]
    """Reasons that hold at any time, in order of harm."""
    default_next_step: str
    """Next step where no reason says one."""
    alarms: tuple[Alarm, ...] = ()
    """Alarms that are open, in the order of their reasons."""
    path: str = ""
    """Path of the folder as it was named, which commands in the reasons repeat."""
    interval_days: float = 0.0
    """Time from tap test to tap test (days)."""
    has_port: bool = False
    """Whether machine.toml names a port, so that a test can be started."""
    newest_tap_id: str = ""
    """Identity of the newest tap test; empty where there is none."""
    last_tap: str = ""
    """Time of the newest tap test (ISO 8601); empty where there is none."""
    tap_tests: int = 0
    """Number of rows of the history."""
    programs: dict[str, str] = {}
    """Word on each program, by its name."""
    fates: dict[str, ProgramForecast] = {}
    """What becomes of each program, by its name."""
    limits: LimitForecasts = ()
    """When the worst series has fallen by the limits of machine.toml."""
    series: tuple[SeriesSummary, ...] = ()
    """Series, the one that fell most first."""

    @cached_property
    def time(self) -> datetime | None:
        """Time of the newest tap test; None where there is none."""
        return datetime.fromisoformat(self.last_tap) if self.last_tap else None

    @property
    def newest_file(self) -> str:
        """The file of the newest tap test in the folder; empty where there is none."""
        return f"taps/{self.newest_tap_id}.h5" if self.newest_tap_id else ""

    def status_at(self, now: datetime, path: Path | str, damage: Sequence[Remark] = ()) -> DatedStatus:
        """The standing at a time, with what is known to be damaged besides; path: of the folder."""
        left, remarks = None, self.remarks
        if self.time is not None:
            left = count_days_left(self.time, self.interval_days, now)
            remarks = sort_by_severity(
                [*remarks, *date_remarks(self.newest_tap_id, self.time, self.interval_days, now, path)]
            )
        if damage:
            remarks = add_damage_remarks(remarks, damage)
        said = add_acknowledgements(remarks, self.alarms, now)
        return DatedStatus(worst_status(remarks), said, find_next_step(remarks, self.default_next_step), left, now)

    def mentions_path(self, path: str) -> bool:
        """Whether a reason names the folder."""
        return any(path in text for remark in self.remarks for text in (remark.text, remark.cure))


def summarize_unreadable(name: str, reason: str) -> MachineSummary:
    """The summary of a machine whose files cannot be read."""
    return MachineSummary(name, (unreadable_remark(reason),), UNREADABLE_NEXT_STEP)


SUMMARY_FILE_NAME = "standing.json"
SUMMARY_FORMAT_NUMBER = 3
"""Number of this form of the file; a file of another is made anew."""
SUMMARY_LIFETIME = timedelta(days=7)
"""Time that a summary and its forecast count; chosen."""
CRC_HEAD_LENGTH = len('{"crc":"01234567",')
"""Bytes of the head of the file; the checksum in it is that of the others as an object of their own."""


class _SummaryFile(msgspec.Struct, frozen=True):
    """The content of the file behind its checksum."""

    format_number: int
    """Number of its form."""
    software: str
    """Version of the program that made it."""
    mark: tuple[int, ...]
    """Mark of the files that it was made of."""
    created: datetime
    """Time of its making."""
    summary: MachineSummary
    """Summary of the machine."""


_encode_file, _decode_file = msgspec.json.Encoder().encode, msgspec.json.Decoder(_SummaryFile).decode


def read_summary(folder: Path, now: datetime) -> MachineSummary | None:
    """The summary beside a machine, where it fits its files; None for none, torn, altered, old, of another version,
    or of another folder."""
    return decode_summary(folder, _read_content(folder), now)


def read_last_summary(folder: Path) -> MachineSummary | None:
    """The summary beside a machine as it was kept last, whatever has become of its files; None for none and torn."""
    file = _decode_checked(_read_content(folder))
    return None if file is None else file.summary


def decode_summary(folder: Path, content: bytes, now: datetime) -> MachineSummary | None:
    """The summary in the content of such a file, as `read_summary` gives it."""
    file = _decode_checked(content)
    if file is None or (file.software, file.mark) != (
        software_version(),
        compute_change_mark(folder, file.summary.newest_file),
    ):
        return None
    age, named = now - file.created, file.summary.path
    if not timedelta(0) <= age < SUMMARY_LIFETIME or (named != str(folder) and file.summary.mentions_path(named)):
        return None
    return file.summary


def encode_summary(summary: MachineSummary, mark: tuple[int, ...], now: datetime) -> bytes:
    """Content of the file; mark: of the files that the summary was made of."""
    body = _encode_file(_SummaryFile(SUMMARY_FORMAT_NUMBER, software_version(), mark, now, summary))
    return _make_crc_head(body) + body[1:]


def write_summary(folder: Path, summary: MachineSummary, mark: tuple[int, ...], now: datetime) -> None:
    """Keep a summary beside the machine, whole or not at all; to be called under the lock.

    OSError where it cannot be written.
    """
    atomic_write(folder / SUMMARY_FILE_NAME, encode_summary(summary, mark, now), lasting=False)


def _read_content(folder: Path) -> bytes:
    """Bytes of the file; none where it cannot be read."""
    try:
        return read_regular_file(folder / SUMMARY_FILE_NAME, MAX_SETTINGS_FILE_SIZE)
    except (OSError, ValueError):
        return b""


def _decode_checked(content: bytes) -> _SummaryFile | None:
    """What the file says; None where it is torn, altered or of another form."""
    body = b"{" + content[CRC_HEAD_LENGTH:]
    try:
        file = _decode_file(body) if content[:CRC_HEAD_LENGTH] == _make_crc_head(body) else None
    except (ValueError, TypeError):
        return None
    return file if file is not None and file.format_number == SUMMARY_FORMAT_NUMBER else None


def _make_crc_head(body: bytes) -> bytes:
    """Head of the file: the checksum as the first field."""
    return b'{"crc":"%08x",' % zlib.crc32(body)


@cache
def software_version() -> str:
    """Version of this program."""
    return version("lobewatch")
