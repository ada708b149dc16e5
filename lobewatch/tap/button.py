"""The button of a device, which takes the last good hit back."""

from __future__ import annotations

from collections import deque

from acquisition import Event, EventKind

BOUNCE_TIME = 0.3
"""A press so soon after the button has moved is its bouncing (s)."""


class Button:
    """Counts presses by the clock of the device: events that wait to be read come all at once."""

    def __init__(self, sample_rate: float) -> None:
        """Not pressed yet; sample_rate: of the scans that events are timed by (Hz)."""
        self._bounce = BOUNCE_TIME * sample_rate
        self._moved: int | None = None

    def presses(self, events: deque[Event]) -> int:
        """Take all events that wait; how often the button was pressed in them."""
        count = 0
        while events:
            event = events.popleft()
            if event.kind == EventKind.BUTTON:
                count += event.begins and (self._moved is None or abs(event.scan - self._moved) >= self._bounce)
                self._moved = event.scan
        return count
