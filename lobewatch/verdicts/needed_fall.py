"""How much decay a recommended setting must stand."""

from __future__ import annotations

from lobewatch.machine import Machine
from lobewatch.tool.assembly import Assembly
from lobewatch.tool.series import fall_in
from lobewatch.verdicts.room import LEAST_FALL

INTERVALS = 2
"""Number of tap intervals that it must last ..."""
UNKNOWN_FALL = 0.02
"""... or fall of the frequency that it must stand where no rate is known; chosen."""


def needed_fall(assembly: Assembly, machine: Machine) -> float:
    """Fall of the frequency that a recommended setting must stand: two tap intervals at the rate so far."""
    days = INTERVALS * machine.machine.tap_interval_days
    falls = [fall_in(series, days) for series in assembly.series.values()]
    return max((UNKNOWN_FALL if fall is None else max(fall, LEAST_FALL) for fall in falls), default=UNKNOWN_FALL)
