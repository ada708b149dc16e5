"""Summarize the status of one machine and keep the summary in standing.json."""

import zlib
from collections.abc import Sequence
from datetime import datetime, timedelta
from functools import cache, cached_property
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import msgspec

from acquisition import Remark
from acquisition.file_io import MAX_SETTINGS_FILE_SIZE, read_regular_file
from lobewatch.machine.folder_files import compute_change_mark
from lobewatch.measurement import tap_age
from lobewatch.monitoring import status_rules
from lobewatch.monitoring.status_rules import Alarm, add_acknowledgements
from lobewatch.monitoring.threshold_dates import LimitForecasts, ProgramForecast

SUMMARY_FILE_NAME = "standing.json"
SUMMARY_FORMAT_NUMBER = 4
"""Number of the file format. A file of another format is rebuilt."""
SUMMARY_LIFETIME = timedelta(days=7)
"""Time that a summary and its forecast are valid; chosen."""
CRC_HEAD_LENGTH = len('{"crc":"01234567",')
"""Bytes of the head of the file. Its checksum is that of the other fields as an object of their own."""


class SeriesSummary(
    msgspec.Struct, frozen=True, rename={"drop": "fall", "drop_std": "fall_std", "drop_half_width": "fall_half_width"}
):
    """Summary of one tool in one direction."""

    name: str
    """Tool and direction, as text."""
    tool: str
    """Tool in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    drop: float | None
    """Frequency drop since the start of the series (%), or None."""
    drop_std: float | None
    """Standard error of the drop with reclamping (%), or None; 0 for the first test."""
    frequency: float | None
    """Natural frequency of the newest point (Hz), or None."""
    alarm: str = ""
    """Kind of the open drop, "step" or "slope". Empty without an alarm."""
    scatter: tuple[float, float] = (0.0, 0.0)
    """Scatter of the points (%) and its degrees of freedom. 0 degrees: not estimated."""
    common_scatter: tuple[float, float] = (0.0, 0.0)
    """Scatter of the mean of both directions (%) and its degrees of freedom, for taps in the same clamping."""
    points: tuple[tuple[float, float], ...] = ()
    """Days since 1970 and frequency change from the start (%), thinned out."""
    drop_half_width: float | None = None
    """Half the width of the 95 % interval of the drop (%), or None; 0 for the first test."""
    is_proven: bool = False
    """True if the frequency has changed for certain."""

    @property
    def drop_interval(self) -> tuple[float, float] | None:
        """Ends of the 95 % interval of the drop (%), or None."""
        if self.drop is None or self.drop_half_width is None:
            return None
        return self.drop - self.drop_half_width, self.drop + self.drop_half_width


class DatedStatus(NamedTuple):
    """Status of a machine at a time."""

    status: status_rules.StatusLevel
    """Status of the most severe reason."""
    remarks: tuple[Remark, ...]
    """Reasons, most severe first."""
    next_step: str
    """Next step, one sentence."""
    days_left: float | None
    """Days until the next tap test is due, negative if it is overdue. None before the first."""
    time: datetime
    """Time of the status."""

    @property
    def is_early(self) -> bool:
        """True if the alarm is a frequency drop below every limit."""
        return status_rules.is_early_alarm(self.remarks)

    @property
    def is_readable(self) -> bool:
        """True if the files of the machine can be read."""
        return all(remark.code != "unreadable" for remark in self.remarks)


class MachineSummary(
    msgspec.Struct,
    frozen=True,
    dict=True,
    rename={"default_next_step": "otherwise", "newest_tap_id": "newest", "forecasts": "fates"},
):
    """Status of a machine that follows from its files, whatever the date."""

    name: str
    """Name of the machine in machine.toml."""
    remarks: tuple[Remark, ...]
    """Reasons that do not depend on the date, most severe first."""
    default_next_step: str
    """Next step if no reason has one."""
    alarms: tuple[Alarm, ...] = ()
    """Open alarms, in the order of their reasons."""
    path: str = ""
    """Path of the folder, as the commands in the reasons repeat it."""
    interval_days: float = 0.0
    """Interval between tap tests (days)."""
    has_port: bool = False
    """True if machine.toml names a port."""
    newest_tap_id: str = ""
    """Identity of the newest tap test, or empty."""
    last_tap: str = ""
    """Time of the newest tap test (ISO 8601), or empty."""
    tap_tests: int = 0
    """Number of rows of the history."""
    programs: dict[str, str] = {}
    """Verdict on each program as of its tap tests, by name; `programs_at` gives those of a time."""
    tap_times: dict[str, datetime] = {}
    """Time that the age of its tap tests counts from, by program; empty without an agreed tap interval."""
    forecasts: dict[str, ProgramForecast] = {}
    """Forecast of each program, by name."""
    limits: LimitForecasts = ()
    """Forecast of each frequency-drop limit of machine.toml, for the worst series."""
    series: tuple[SeriesSummary, ...] = ()
    """Series, that of the most severe reason first, then that of the largest frequency drop."""

    @cached_property
    def time(self) -> datetime | None:
        """Time of the newest tap test, or None."""
        return datetime.fromisoformat(self.last_tap) if self.last_tap else None

    @property
    def newest_file(self) -> str:
        """File of the newest tap test in the folder, or empty."""
        return f"taps/{self.newest_tap_id}.h5" if self.newest_tap_id else ""

    def programs_at(self, now: datetime) -> dict[str, str]:
        """Return the verdict on each program at a time: not stable but doubtful if its tap tests are too old."""
        return self.programs | dict.fromkeys(self._outdated_programs(now), "doubtful")

    def _outdated_programs(self, now: datetime) -> list[str]:
        """Return the names of stable programs whose tap tests are too old."""
        stable = [name for name, verdict in self.programs.items() if verdict == "stable" and name in self.tap_times]
        return [name for name in stable if tap_age.is_too_old(self.tap_times[name], now, self.interval_days)]

    def status_at(
        self, now: datetime, path: Path | str, damage: Sequence[Remark] = (), copies: Sequence[Remark] = ()
    ) -> DatedStatus:
        """Return the status at a time, with damage found since and copies of the folder, whose path is `path`."""
        left, remarks = None, status_rules.sort_by_severity([*self.remarks, *copies])
        if self.time is not None:
            left = status_rules.count_days_left(self.time, self.interval_days, now)
            dated = status_rules.date_remarks(self.newest_tap_id, self.time, self.interval_days, now, path)
            old = self._outdated_programs(now)
            aged = [tap_age.too_old_remark(name, self.tap_times[name], now, self.interval_days) for name in old]
            remarks = status_rules.sort_by_severity([*remarks, *dated, *aged])
        if damage:
            remarks = status_rules.add_damage_remarks(remarks, damage)
        acknowledged = add_acknowledgements(remarks, self.alarms, now)
        next_step = status_rules.find_next_step(remarks, self.default_next_step)
        return DatedStatus(status_rules.worst_status(remarks), acknowledged, next_step, left, now)


def summarize_unreadable(name: str, reason: str) -> MachineSummary:
    """Make the summary of a machine whose files cannot be read."""
    return MachineSummary(name, (status_rules.unreadable_remark(reason),), status_rules.UNREADABLE_NEXT_STEP)


class _SummaryFile(msgspec.Struct, frozen=True, rename={"format_number": "make", "created": "made"}):
    """Content of standing.json behind its checksum."""

    format_number: int
    """Number of the file format."""
    software: str
    """Version of lobewatch that wrote the file."""
    mark: tuple[int, ...]
    """Change mark of the summarized files."""
    created: datetime
    """Time of the summary."""
    summary: MachineSummary
    """Summary of the machine."""


_encode_file, _decode_file = msgspec.json.Encoder().encode, msgspec.json.Decoder(_SummaryFile).decode


def read_summary(folder: Path, now: datetime) -> MachineSummary | None:
    """Read the summary of a machine folder.

    None if it is missing, damaged, outdated, of another version, or of another folder.
    """
    return decode_summary(folder, _read_content(folder), now)


def read_last_summary(folder: Path) -> MachineSummary | None:
    """Read the last stored summary of a machine folder, even if it is outdated. None if it is missing or damaged."""
    file = _decode_checked(_read_content(folder))
    return None if file is None else file.summary


def decode_summary(folder: Path, content: bytes, now: datetime) -> MachineSummary | None:
    """Decode the content of standing.json, as `read_summary` does."""
    file = _decode_checked(content)
    if file is None or file.software != software_version():
        return None
    summary, age = file.summary, now - file.created
    if file.mark != compute_change_mark(folder, summary.newest_file) or not timedelta(0) <= age < SUMMARY_LIFETIME:
        return None
    texts = (text for remark in summary.remarks for text in (remark.text, remark.cure))
    return None if summary.path != str(folder) and any(summary.path in text for text in texts) else summary


def encode_summary(summary: MachineSummary, mark: tuple[int, ...], now: datetime) -> bytes:
    """Encode the content of standing.json. `mark` is the change mark of the summarized files."""
    body = _encode_file(_SummaryFile(SUMMARY_FORMAT_NUMBER, software_version(), mark, now, summary))
    return _make_crc_head(body) + body[1:]


def _read_content(folder: Path) -> bytes:
    """Read standing.json. Empty if it cannot be read."""
    try:
        return read_regular_file(folder / SUMMARY_FILE_NAME, MAX_SETTINGS_FILE_SIZE)
    except (OSError, ValueError):
        return b""


def _decode_checked(content: bytes) -> _SummaryFile | None:
    """Decode the content. None if it is damaged or of another format."""
    body = b"{" + content[CRC_HEAD_LENGTH:]
    try:
        file = _decode_file(body) if content[:CRC_HEAD_LENGTH] == _make_crc_head(body) else None
    except (ValueError, TypeError):
        return None
    return file if file is not None and file.format_number == SUMMARY_FORMAT_NUMBER else None


def _make_crc_head(body: bytes) -> bytes:
    return b'{"crc":"%08x",' % zlib.crc32(body)


@cache
def software_version() -> str:
    """Return the version of lobewatch."""
    return version("lobewatch")
