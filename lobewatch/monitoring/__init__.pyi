"""How a series of tap tests decays: points, alarm, forecast; arrays in, records out."""

from .machine_status import MachineStatus, SeriesStatus
from .status_rules import StatusLevel

__all__ = [
    "MachineStatus",
    "SeriesStatus",
    "StatusLevel",
]
