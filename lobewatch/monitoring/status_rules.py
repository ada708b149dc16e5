"""Status of a machine by remark code, in order of severity, remarks by date, and alarms.

Imported with every look at a fleet, so without numpy.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from datetime import datetime, timedelta
from enum import StrEnum
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import msgspec

from acquisition import Remark
from lobewatch.machine.journal.alarm_entries import Acknowledgement, format_alarm_id
from lobewatch.measurement.clock_questions import CLOCK_QUESTIONS, future_tap_remarks
from lobewatch.measurement.tap_age import TOO_OLD_CODE


class Alarm(msgspec.Struct, frozen=True, rename={"triggered_by": "raised_by", "triggered_at": "raised"}):
    """Open alarm. Its identity is its code, its series or program, and the tap test that first triggered it."""

    code: str
    """Code of the remark."""
    about: str
    """Series or program."""
    triggered_by: str = msgspec.field(name="raised_by")
    """Id of the tap test that triggered it."""
    triggered_at: datetime = msgspec.field(name="raised")
    """Time of that tap test."""
    acknowledgement: Acknowledgement | None = None
    """Newest acknowledgement; None without one."""

    @property
    def id(self) -> str:
        """Id of the alarm for people and other programs, without blanks."""
        return format_alarm_id(self.code, self.about, self.triggered_by)

    def is_acknowledged(self, now: datetime) -> bool:
        """Return whether it is acknowledged at a time."""
        return self.acknowledgement is not None and self.acknowledgement.is_active_at(now)

    def to_row(self, now: datetime) -> dict[str, Any]:
        """Return the fields for other programs; times are ISO 8601, `acknowledged` is null if it is not."""
        word, acknowledged = self.acknowledgement, None
        if word is not None and word.is_active_at(now):
            until = word.until and word.until.isoformat()
            acknowledged = {"time": word.time.isoformat(), "operator": word.operator, "until": until, "note": word.note}
        row = {"id": self.id, "code": self.code, "about": self.about, "raised_by": self.triggered_by}
        return row | {"raised": self.triggered_at.isoformat(), "acknowledged": acknowledged}


class TriggeredAlarm(NamedTuple):
    """Remark with an active alarm, and the tap test that first triggered it."""

    remark: Remark
    """Remark of the alarm."""
    tap_id: str
    """Id of the tap test."""
    time: datetime
    """Time of the tap test."""

    def build_alarm(self, acknowledgements: Iterable[Acknowledgement], baseline: datetime | None) -> Alarm:
        """Build the alarm, with its newest acknowledgement since it was triggered."""
        code, about = self.remark.code, self.remark.about
        words = (word for word in acknowledgements if self.time <= word.newest)
        given = [word for word in words if (word.code, word.about, word.baseline) == (code, about, baseline)]
        return Alarm(code, about, self.tap_id, self.time, given[-1] if given else None)


def add_acknowledgements(remarks: Iterable[Remark], alarms: Sequence[Alarm], now: datetime) -> tuple[Remark, ...]:
    """Add acknowledgements to the text of remarks."""
    active = [alarm for alarm in reversed(alarms) if alarm.is_acknowledged(now)]
    words = {(alarm.code, alarm.about): alarm.acknowledgement for alarm in active}
    known = [(remark, words.get((remark.code, remark.about))) for remark in remarks]
    return tuple(replace(remark, text=f"{remark.text} ({word})") if word else remark for remark, word in known)


def select_alarms(alarms: Sequence[Alarm], name: str, now: datetime) -> list[Alarm]:
    """Select the alarm of this identity or part of one, or all that are not acknowledged."""
    if not alarms:
        raise ValueError("no open alarm to acknowledge")
    exact = [alarm for alarm in alarms if alarm.id == name]
    fitting = exact or [alarm for alarm in alarms if (name in alarm.id if name else not alarm.is_acknowledged(now))]
    names = ", ".join(alarm.id for alarm in alarms)
    if not fitting and not name:
        raise ValueError(f"all alarms are acknowledged already. Name the alarm to change: {names}.")
    if not fitting or (name and len(fitting) > 1):
        what = f"matches {len(fitting)} alarms" if fitting else "is not an open alarm"
        raise ValueError(f"{name!r} {what}. Choose one of: {names}.")
    return fitting


CodedT = TypeVar("CodedT", Remark, Alarm)
"""Remark or alarm with a code."""


class StatusLevel(StrEnum):
    """Status of a machine (ISO 13374), worst first."""

    ALARM = "alarm"
    """Beyond a limit: a drop, a faster decay, or a program that is no longer stable."""
    UNKNOWN = "unknown"
    """Unknown: damaged, unreadable or never tapped."""
    WARN = "warn"
    """Attention needed: a smaller drop, a doubtful program, damage, a test that is due."""
    GOOD = "good"
    """No known problem."""


ALARM, UNKNOWN, WARN, GOOD = StatusLevel


class StatusRule(NamedTuple):
    """A rule of the machine status: what a remark code means, with its texts; words in braces are filled in."""

    code: str
    """Code of the remark."""
    status: StatusLevel
    """Status of a machine with this remark."""
    text: str = ""
    """Sentence of the remark; empty if another package writes it."""
    remedy: str = ""
    """Next step."""
    is_limit: bool = False
    """True if a limit of machine.toml or a program is exceeded: then an alarm is not early."""

    def remark(self, about: str, remedy: str = "", **values: object) -> Remark:
        """Build the remark on a series, a program or a file, with another remedy if given."""
        return Remark(self.code, about, self.text.format(**values), (remedy or self.remedy).format(**values))


FREQUENCY_ALARM = StatusRule(
    "frequency-alarm",
    ALARM,
    "frequency {drop} (alarm at {limit:g} %)",
    "Stop. Inspect bearings, tool and clamping, then repeat the tap test.",
    is_limit=True,
)
FREQUENCY_DECAY = StatusRule(
    "decay",
    ALARM,
    "frequency {kind} {since:%Y-%m-%d}, now {drop}{run_in}",
    "Inspect bearings, tool and clamping. Then run {event} after a repair, "
    "or operator_entries.acknowledge_alarms {folder} if the cause is known.",
)
PROGRAM_NOT_STABLE = StatusRule(
    "program-not-stable",
    ALARM,
    "{stability}",
    "Change speed or depth before the next part. Logbook.verdicts suggests safe values.",
    is_limit=True,
)
UNREADABLE = StatusRule("unreadable", UNKNOWN, "{reason}")
NEVER_TAPPED = StatusRule(
    "never-tapped", UNKNOWN, "no tap test {since}", "Take the first tap test, the reference for all later tests"
)
FREQUENCY_WARNING = StatusRule(
    "frequency-warn",
    WARN,
    "frequency {drop} (warning at {limit:g} %)",
    "Repeat the tap test. If the second test confirms the drop, inspect bearings and clamping soon.",
    is_limit=True,
)
DOUBTFUL_DECAY = StatusRule(
    "decay-doubtful",
    WARN,
    "frequency of the newest test is lower than in earlier tests",
    "Reclamp the tool, then run TapSession.run {folder} Conditions.reclamped to check the drop",
)
FIRST_TEST_DIFFERS = StatusRule(
    "first-test-differs",
    WARN,
    "frequency of one of the first tests ({tap_id}) is {distance:.1f} % {side} the others, so the start is uncertain",
    "Check if the spindle changed after this test. If it did, run {event}, else {exclude}",
)
MODE_LOST = StatusRule(
    "mode-lost",
    WARN,
    "followed mode not found in the newest test",
    "Repeat the tap test",
)
OVERDUE = StatusRule("overdue", WARN, "tap test overdue by {days}", "Take the tap test")
PROGRAM_UNKNOWN = StatusRule(
    "program-unknown", WARN, "{stability}", "Run Logbook.verdicts for the reason for this verdict"
)
PROGRAM_DOUBTFUL = StatusRule(
    "program-doubtful",
    WARN,
    "{stability}",
    "Run Logbook.verdicts for the cause of this verdict and for safe values",
)
FREQUENCY_ROSE = StatusRule(
    "frequency-rose", GOOD, "frequency rose, now {drop} (assembly changed?)", "Run {event} if the assembly was changed"
)
NEWEST_HIGH = StatusRule(
    "newest-test-high",
    GOOD,
    "frequency of the newest test is higher than in earlier tests",
    "Reclamp the tool, then run TapSession.run {folder} Conditions.reclamped to check the rise",
)
VALUE_CHANGED = StatusRule(
    "value-changed",
    GOOD,
    "{value} {kind} {since:%Y-%m-%d}, by {change} (used in verdicts, not in the status)",
)
SCATTER_CORRELATED = StatusRule(
    "scatter-correlated",
    GOOD,
    "scatter of f1 repeats from test to test (correlation {correlation:.2f}), so {share:.0%} of healthy spindles have "
    "a false alarm in 24 tests",
    "Reclamp the tool for every test, and record operator and temperature",
)
SCATTER_GROUPS = StatusRule(
    "scatter-groups",
    GOOD,
    "f1 scatters in two groups {distance:.2g} % apart, for example of two operators or two ways of clamping. "
    "The false alarm rate is unknown",
    "Record the operator of every test",
)
CLAMP_ALIKE = "Clamp the tool in the same way for every test"
"""Next step for two groups if all operators are recorded."""
ONE_DIRECTION = StatusRule(
    "one-direction",
    GOOD,
    "tapped in direction {direction} only",
    "Tap direction {missing} of this tool as well, because verdicts need both directions",
)
FOLDER_COPIED = StatusRule(
    "folder-copied", GOOD, "same tap tests as folder {folders}", "Keep one of these folders and move its copy elsewhere"
)
EVENT_CALL = 'folder_updates.add_event {folder} "what was done" add_event.new_baseline'
"""Call that records a repair in the journal of a folder."""
OUTLIER_CALLS = {
    "event": EVENT_CALL,
    "exclude": 'folder_updates.exclude_entry {folder} {tap_id} exclude_entry.reason "badly clamped"',
}
"""Calls that begin a new series, or exclude a tap test."""


def _rules_of(*codes: str) -> list[StatusRule]:
    """Rules of warnings that other packages write."""
    return [StatusRule(code, WARN) for code in codes]


STATUS_RULES = (
    *(FREQUENCY_ALARM, FREQUENCY_DECAY, PROGRAM_NOT_STABLE, UNREADABLE, NEVER_TAPPED),
    *_rules_of("journal-damaged", "sync-conflict", "sync-contradiction", "journal-newer", "line-damaged"),
    *_rules_of("tap-damaged", "tap-unreadable", "tap-unlisted"),
    *_rules_of("file-damaged", "cut-damaged", "cut-unlisted"),
    *(FREQUENCY_WARNING, DOUBTFUL_DECAY),
    *_rules_of("frequency-jump"),
    *(FIRST_TEST_DIFFERS, MODE_LOST),
    *_rules_of("wrong-quantity", "wrong-unit"),
    *_rules_of("no-mode-in-band", "no-mode-to-follow", "other-band", "stiffness-jump", "stiffness-off-model"),
    *_rules_of("direction-stiffness", "same-direction", "tool-compliance"),
    *_rules_of("mode-jump", "exchanged-directions", "damping-jump"),
    *_rules_of(
        *CLOCK_QUESTIONS,
        "emulated-device",
        "one-hit",
        "spindle-turning",
        "rate-not-verified",
        "tap-in-future",
        TOO_OLD_CODE,
    ),
    *_rules_of("chain-not-checked"),
    *(OVERDUE, PROGRAM_UNKNOWN, PROGRAM_DOUBTFUL, FOLDER_COPIED, FREQUENCY_ROSE, NEWEST_HIGH, VALUE_CHANGED),
    *(SCATTER_CORRELATED, SCATTER_GROUPS, ONE_DIRECTION),
)
"""All rules of the machine status, in order of severity; an unknown code is an error."""
STATUS_BY_CODE = {rule.code: rule.status for rule in STATUS_RULES}
"""Status by remark code, in order of severity."""
UNREADABLE_NEXT_STEP = "Repair or restore the unreadable file"
"""Next step for a machine that cannot be read."""


def is_alarm(remark: Remark) -> bool:
    """Return whether a remark is an alarm."""
    return STATUS_BY_CODE[remark.code] is ALARM


def unreadable_remark(reason: str) -> Remark:
    """Return the remark on a machine whose files cannot be read."""
    return UNREADABLE.remark("", reason=reason)


def sort_by_severity(remarks: Iterable[CodedT]) -> tuple[CodedT, ...]:
    """Sort remarks or alarms by severity."""
    order = list(STATUS_BY_CODE)
    return tuple(sorted(remarks, key=lambda remark: order.index(remark.code)))


def worst_status(ordered: Sequence[Remark]) -> StatusLevel:
    """Return the status of the most severe remark."""
    return STATUS_BY_CODE[ordered[0].code] if ordered else GOOD


def is_early_alarm(ordered: Sequence[Remark]) -> bool:
    """Return whether the only alarm is a detected drop short of every limit and program."""
    codes = {remark.code for remark in ordered}
    return worst_status(ordered) is ALARM and not any(rule.code in codes for rule in STATUS_RULES if rule.is_limit)


def find_next_step(ordered: Sequence[Remark], default_step: str) -> str:
    """Return the next step; default_step: if no remark has one. A copied folder keeps the step of its machine."""
    cures = [remark.cure for remark in ordered if remark.code != FOLDER_COPIED.code]
    return cures[0] if cures and cures[0] else default_step


def next_tap_step(newest: datetime, interval_days: float) -> str:
    """Return the next step of a machine without problems; newest: time of the last tap test."""
    return f"No problem found. Tap again by {newest + timedelta(days=math.floor(interval_days)):%Y-%m-%d}."


def count_days_left(newest: datetime, interval_days: float, now: datetime) -> float:
    """Return the days until the next tap test is due; newest: time of the last one."""
    return interval_days - (now - newest) / timedelta(days=1)


def date_remarks(tap_id: str, newest: datetime, days: float, now: datetime, path: Path | str) -> Iterator[Remark]:
    """Yield remarks by date: a test is overdue, or in the future; days: tap interval; path: of the folder."""
    left = count_days_left(newest, days, now)
    if left < 0:
        late = math.ceil(-left)
        yield OVERDUE.remark("", days=f"{late} day{'s' if late > 1 else ''}")
    yield from future_tap_remarks(tap_id, newest, now, path)


def add_file_remedy(remark: Remark) -> Remark:
    """Add a remedy that can be the next step to a remark on a file."""
    return replace(remark, cure=f"{remark.about}: {remark.cure or remark.text}")


def add_damage_remarks(ordered: tuple[Remark, ...], damage: Sequence[Remark]) -> tuple[Remark, ...]:
    """Add the remarks on damaged files to those of the machine."""
    named = {(remark.code, remark.about) for remark in ordered}
    new = [add_file_remedy(remark) for remark in damage if (remark.code, remark.about) not in named]
    return sort_by_severity([*ordered, *new])
