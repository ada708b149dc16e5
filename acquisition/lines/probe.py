"""Whether a board on a port prints lines of numbers."""

from __future__ import annotations

import time

from acquisition.lines.text import LineDecoder
from acquisition.ports.serial_link import SerialLink
from acquisition.source import DeviceIdentity

LISTEN_TIME = 1.0
"""Time for which is listened (s)."""
FEWEST = 20
"""Lines of as many numbers without a broken one between them that make a board of it."""


def probe_lines(link: SerialLink) -> DeviceIdentity | None:
    """Who prints there, told by listening alone; None where nobody does. It has no serial number of its own."""
    decoder, lines, columns = LineDecoder(), 0, 0
    deadline = time.monotonic() + LISTEN_TIME
    while lines < FEWEST and (left := deadline - time.monotonic()) > 0:
        for printed in decoder.feed(link.read(left)):
            lines = len(printed.rows) + (0 if printed.broken_before else lines)
            columns = printed.rows.shape[1]
    return DeviceIdentity(f"a board that prints {columns} numbers a line") if lines >= FEWEST else None
