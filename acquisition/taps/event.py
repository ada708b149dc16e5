"""EVENT frames of TAPS/1: their bodies, and what has been told by them so far."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Mapping

from acquisition.channel import Channel
from acquisition.event import Event, EventKind
from acquisition.taps.protocol import Frame

KEPT = 256
"""Events kept for one who does not take them."""
_BODY = struct.Struct("<BBBQ")
_NO_CHANNEL = 0xFF

_FAULTS = {
    EventKind.CABLE: "the cable of the {} sensor is broken or not plugged in: check it at both ends",
    EventKind.SENSOR_BIAS: "the {} sensor has no proper supply (bias voltage out of range): check the sensor, "
    "its cable and the IEPE switch",
}


def encode_event(event: Event) -> bytes:
    """The body of an EVENT frame."""
    channel = _NO_CHANNEL if event.channel is None else event.channel
    return _BODY.pack(event.kind, channel, event.begins, event.scan)


def decode_event(body: bytes) -> Event:
    """The event in a body; struct.error for one of the wrong length."""
    kind, channel, begins, scan = _BODY.unpack(body)
    return Event(kind, bool(begins), None if channel == _NO_CHANNEL else channel, scan)


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
            event = decode_event(frame.body)
        except struct.error:
            return
        self.new.append(event)
        remaining = (fault for fault in self._standing if (fault.kind, fault.channel) != (event.kind, event.channel))
        self._standing = (*remaining, event) if event.begins and event.kind in _FAULTS else tuple(remaining)

    def fault(self, channels: Mapping[int, Channel]) -> str:
        """One sentence on the faults that stand; empty where all is well. channels: by their i in INFO."""
        return "; ".join(_FAULTS[EventKind(event.kind)].format(_name(event, channels)) for event in self._standing)


def _name(event: Event, channels: Mapping[int, Channel]) -> str:
    if event.channel is None:
        return "force or acceleration"
    return channels[event.channel].quantity if event.channel in channels else f"(channel {event.channel})"
