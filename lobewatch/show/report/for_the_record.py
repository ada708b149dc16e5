"""What whoever signs the report must know: what was measured with what, what is watched, how surely, what is not seen.

What such a report says: ISO 17359 (condition monitoring) and ISO 13381-1 (prognostics).
"""

from __future__ import annotations

from collections.abc import Sequence

from acquisition import Channel, TapTest
from lobewatch.decay.alarm import Alarm
from lobewatch.decay.forecast import ENOUGH
from lobewatch.show.report.material import ReportMaterial
from lobewatch.show.report.section import BulletList, DataTable, Paragraph, Section

WATCHED = (
    "loss of stiffness of bearings, joints and clamping, seen as a fall of the natural frequency that is followed at "
    "the tool tip, spindle standing"
)
"""Failure mode."""
NOT_SEEN: Sequence[str] = (
    "damage that leaves the stiffness as it is: pitting, cage, lubrication, seals, unbalance, motor, drawbar below its "
    "clamping force",
    "what heat and speed do to the preload while the spindle turns",
    "what has happened since the newest tap test",
)
"""What no tap test shows."""
SURE = (
    "alarm: two clampings running, each with a chance of 1 in 2000 of being scatter alone; of 100 healthy series 5 "
    "raise one in 60 clampings"
)
"""Confidence of the alarm; measured, docs/decay.md."""
DATES = "dates: 80 % ranges, if the machine is used as before"
"""Confidence of the forecast."""


def for_the_record(material: ReportMaterial) -> list[Section]:
    """The last section, with room for a signature."""
    points = 0 if material.series.trend is None else len(material.series.trend.points)
    rows = [
        ("machine", material.machine.machine.name),
        ("folder", material.analysis.folder.path.resolve().name),
        ("tool, direction", material.series.name),
        ("newest tap test", f"{material.last.time.astimezone():%Y-%m-%d %H:%M}"),
        ("hammer held by", material.newest.circumstances.operator or "not said"),
        ("device", material.newest.circumstances.device or "not known: a recorded file"),
        *_sensors(material.newest),
        ("failure mode watched", WATCHED),
        ("confidence", f"{SURE if points > ENOUGH else 'no alarm by scatter below 9 clampings'}; {DATES}"),
        *[("alarm", _alarm_text(alarm)) for alarm in material.outlook.standing.alarms],
        ("name, date, signature", ""),
    ]
    unseen = Paragraph("It does not see:"), BulletList(NOT_SEEN)
    return [Section("For whoever signs", [DataTable(["what", "is"], rows, "words"), *unseen])]


def _alarm_text(alarm: Alarm) -> str:
    word = alarm.acknowledgement or "not acknowledged"
    return f"{alarm.about}: {alarm.code}, raised {alarm.raised.astimezone():%Y-%m-%d}, {word}; name: {alarm.id}"


def _sensors(tap: TapTest) -> list[tuple[str, str]]:
    """A row for each sensor of a live test."""
    channels = tap.hits[0].channels if tap.hits else None
    names = {"force": "hammer", "acceleration": "accelerometer"}
    return [(names[channel.quantity], _sensor_text(channel)) for channel in channels or ()]


def _sensor_text(channel: Channel) -> str:
    unit = "N" if channel.quantity == "force" else "(m/s²)"
    number = f"serial number {channel.serial_number}" if channel.serial_number else "serial number not known"
    calibrated = f"calibrated {channel.calibration_date}" if channel.calibration_date else "calibration not known"
    return f"{number}, {1e3 * channel.sensitivity:.4g} mV/{unit}, {calibrated}"
