"""Simple binary frames, such as SerialPlot's custom frames: start bytes, a payload of fixed size, a checksum.

The payload is a scan: the counter (u16), where there is one, and a value (i16) a sensor, little-endian. The checksum is
the lowest byte of the sum of the payload's bytes (SerialPlot, "custom frame format").
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from acquisition.lines.scans import Printed


@dataclass(frozen=True)
class FrameFormat:
    """How a frame is built."""

    start: bytes
    """Bytes with which a frame begins."""
    counter: bool = False
    """Whether a counter (u16) stands before the values."""
    checksum: bool = True
    """Whether a checksum follows."""


class SimpleFrameDecoder:
    """Finds rows of numbers in a stream of frames."""

    def __init__(self, form: FrameFormat, values: int = 2) -> None:
        """values: in a frame, beside the counter. What stands before the first whole frame is not counted."""
        self._form, self._rest, self._broken, self._begun = form, b"", 0, False
        self._payload = 2 * (values + form.counter)
        self._size = len(form.start) + self._payload + form.checksum

    def feed(self, data: bytes) -> Iterator[Printed]:
        """The rows that are complete; bytes between frames, and a wrong checksum, are a broken frame."""
        form, received, place = self._form, self._rest + data, 0
        rows: list[tuple[int, ...]] = []
        while (begin := received.find(form.start, place)) >= 0 and len(received) - begin >= self._size:
            payload = received[begin + len(form.start) :][: self._payload]
            good = not form.checksum or received[begin + self._size - 1] == sum(payload) & 0xFF
            if self._begun and (begin > place or not good):
                if rows:
                    yield self._printed(rows)
                rows, self._broken = [], self._broken + 1
            if good:
                rows.append(_scan(payload, form.counter))
            self._begun, place = self._begun or good, begin + (self._size if good else 1)
        self._rest = received[place:]
        if rows:
            yield self._printed(rows)

    def _printed(self, rows: list[tuple[int, ...]]) -> Printed:
        printed, self._broken = Printed(np.array(rows, np.float64), self._broken), 0
        return printed


def _scan(payload: bytes, counter: bool) -> tuple[int, ...]:
    words = tuple(int(word) for word in np.frombuffer(payload, "<i2"))
    return (words[0] & 0xFFFF, *words[1:]) if counter else words
