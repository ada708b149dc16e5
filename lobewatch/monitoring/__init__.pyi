"""Condition monitoring of a series of tap tests: changes, alarms, forecasts, machine status."""

from .machine_status import MachineStatus, SeriesStatus
from .status_rules import StatusLevel

__all__ = [
    "MachineStatus",
    "SeriesStatus",
    "StatusLevel",
]
