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
MOST = 5
"""Numbers in a line: counter, force and three axes of acceleration, or fewer."""


def probe_lines(link: SerialLink) -> DeviceIdentity | None:
    """Who prints there, told by listening alone; None where nobody does. It has no serial number of its own."""
    decoders = {count: LineDecoder((count,)) for count in range(1, MOST + 1)}
    lines = dict.fromkeys(decoders, 0)
    deadline = time.monotonic() + LISTEN_TIME
    while max(lines.values()) < FEWEST and (left := deadline - time.monotonic()) > 0:
        heard = link.read(left)
        for count, decoder in decoders.items():
            for printed in decoder.feed(heard):
                lines[count] = len(printed.rows) + (0 if printed.broken_before else lines[count])
    likeliest = max(lines, key=lambda count: lines[count])
    if lines[likeliest] < FEWEST:
        return None
    return DeviceIdentity(f"a board that prints {likeliest} number{'s' * (likeliest > 1)} a line")
