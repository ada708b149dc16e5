"""What happens at a device: a button pressed, a cable pulled, a sensor without its supply."""

from __future__ import annotations

import enum
from dataclasses import dataclass


class EventKind(enum.IntEnum):
    """What has happened."""

    BUTTON = 1
    """A button at the device was pressed: it undoes the last hit."""
    CABLE = 2
    """The cable of a channel is not plugged in."""
    SENSOR_BIAS = 3
    """A sensor has no supply, or does not take it: its bias voltage is out of range."""


@dataclass(frozen=True)
class Event:
    """One thing that a device has told."""

    kind: int
    """An EventKind; unknown ones are passed on."""
    begins: bool = True
    """Pressed, or a fault has come; False: released, or the fault has gone."""
    channel: int | None = None
    """Channel of the cable or sensor; None for none."""
    scan: int = 0
    """Time of the event, in scans taken since the start of the stream."""
