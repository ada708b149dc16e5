"""EVENT frames of TAPS/1: a button pressed, a cable pulled, a sensor without its supply."""

from __future__ import annotations

import enum
import struct
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

from acquisition.channel import Channel
from acquisition.taps.protocol import Frame

KEPT = 256
"""Events kept for one who does not take them."""
_BODY = struct.Struct("<BBBQ")
_NO_CHANNEL = 0xFF


class EventKind(enum.IntEnum):
    """First byte of the body."""

    BUTTON = 1
    CABLE = 2
    SENSOR_BIAS = 3


_FAULTS = {
    EventKind.CABLE: "the cable of the {} sensor is broken or not plugged in: check it at both ends",
    EventKind.SENSOR_BIAS: "the {} sensor has no proper supply (bias voltage out of range): check the sensor, "
    "its cable and the IEPE switch",
}


@dataclass(frozen=True)
class Event:
    """Body of an EVENT frame."""

    kind: int
    """An EventKind; unknown ones are passed on."""
    begins: bool = True
    """Pressed, or a fault has come; False: released, or the fault has gone."""
    channel: int | None = None
    """Whose cable or sensor; None for none."""
    scan: int = 0
    """When: scans taken since START."""

    def encode(self) -> bytes:
        """The body."""
        return _BODY.pack(self.kind, _NO_CHANNEL if self.channel is None else self.channel, self.begins, self.scan)

    @classmethod
    def decode(cls, body: bytes) -> Event:
        """The event in a body; struct.error for one of the wrong length."""
        kind, channel, begins, scan = _BODY.unpack(body)
        return cls(kind, bool(begins), None if channel == _NO_CHANNEL else channel, scan)


class EventLog:
    """Events not yet taken, and the faults that stand; one thread adds, any other may take and look."""

    def __init__(self) -> None:
        """Nothing has happened."""
        self.new: deque[Event] = deque(maxlen=KEPT)
        self._standing: tuple[Event, ...] = ()
        self._last: tuple[int, int] | None = None

    def add(self, frame: Frame) -> None:
        """Take in an EVENT frame; one that came before, or that is none, changes nothing."""
        if self._last == (frame.session, frame.seq):
            return
        self._last = frame.session, frame.seq
        try:
            event = Event.decode(frame.body)
        except struct.error:
            return
        self.new.append(event)
        others = (fault for fault in self._standing if (fault.kind, fault.channel) != (event.kind, event.channel))
        self._standing = (*others, event) if event.begins and event.kind in _FAULTS else tuple(others)

    def fault(self, channels: Mapping[int, Channel]) -> str:
        """One sentence on the faults that stand; empty where all is well. channels: by their i in INFO."""
        return "; ".join(_FAULTS[EventKind(event.kind)].format(_name(event, channels)) for event in self._standing)


def _name(event: Event, channels: Mapping[int, Channel]) -> str:
    if event.channel is None:
        return "force or acceleration"
    return channels[event.channel].quantity if event.channel in channels else f"(channel {event.channel})"
