"""The standing of a machine in short, for many at once: what follows from its files, and what the date adds."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import msgspec

from acquisition import Remark
from lobewatch.decay.alarm import Alarm, with_acknowledgements
from lobewatch.decay.light import (
    UNREADABLE,
    Light,
    about_dates,
    about_unreadable,
    days_left,
    in_order,
    is_early,
    light_of,
    next_step,
    with_files,
)
from lobewatch.decay.reach import Fate, Limits


class SeriesSummary(msgspec.Struct, frozen=True):
    """The summary of one tool in one direction."""

    name: str
    """Tool and direction, in words."""
    tool: str
    """Tool in the spindle."""
    direction: str
    """Direction at the tool tip, "x" or "y"."""
    fall: float | None
    """Fall of the frequency from the start of the series (%); None where it is not known."""
    fall_std: float | None
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


class DatedStanding(NamedTuple):
    """The standing of a machine at a time."""

    light: Light
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
        return is_early(self.remarks)

    @property
    def can_be_judged(self) -> bool:
        """Whether anything can be said of the machine, be it that it was never tapped."""
        return all(remark.code != "unreadable" for remark in self.remarks)


class Summary(msgspec.Struct, frozen=True, dict=True):
    """The standing of a machine, without what the date of today adds."""

    name: str
    """Name of the machine in machine.toml."""
    remarks: tuple[Remark, ...]
    """Reasons that hold at any time, in order of harm."""
    otherwise: str
    """Next step where no reason says one."""
    alarms: tuple[Alarm, ...] = ()
    """Alarms that are open, in the order of their reasons."""
    path: str = ""
    """Path of the folder as it was named, which commands in the reasons repeat."""
    interval_days: float = 0.0
    """Time from tap test to tap test (days)."""
    has_port: bool = False
    """Whether machine.toml names a port, so that a test can be started."""
    newest: str = ""
    """Identity of the newest tap test; empty where there is none."""
    last_tap: str = ""
    """Time of the newest tap test (ISO 8601); empty where there is none."""
    tap_tests: int = 0
    """Number of rows of the history."""
    programs: dict[str, str] = {}
    """Word on each program, by its name."""
    fates: dict[str, Fate] = {}
    """What becomes of each program, by its name."""
    limits: Limits = ()
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
        return f"taps/{self.newest}.h5" if self.newest else ""

    def at(self, now: datetime, path: Path | str, damage: Sequence[Remark] = ()) -> DatedStanding:
        """The standing at a time, with what is known to be damaged besides; path: of the folder."""
        left, remarks = None, self.remarks
        if self.time is not None:
            left = days_left(self.time, self.interval_days, now)
            remarks = in_order([*remarks, *about_dates(self.newest, self.time, self.interval_days, now, path)])
        if damage:
            remarks = with_files(remarks, damage)
        said = with_acknowledgements(remarks, self.alarms, now)
        return DatedStanding(light_of(remarks), said, next_step(remarks, self.otherwise), left, now)

    def speaks_of(self, path: str) -> bool:
        """Whether a reason names the folder."""
        return any(path in text for remark in self.remarks for text in (remark.text, remark.cure))


def unreadable_summary(name: str, reason: str) -> Summary:
    """The summary of a machine whose files cannot be read."""
    return Summary(name, (about_unreadable(reason),), UNREADABLE)
