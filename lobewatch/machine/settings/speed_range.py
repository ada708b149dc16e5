"""Speed ranges as people type them: `1000 24000`, `1,000-24,000`, `8000..24000 rpm`."""

import re

from lobewatch.machine.settings.number_text import parse_numbers, read_numbers
from lobewatch.machine.settings.setup_tables import SpeedTable
from lobewatch.machine.settings.toml import find_plausible_ranges

SPEED_UNIT_PATTERN = re.compile(r"(?<=\d)\s*(?:rpm|1/min)\b", re.IGNORECASE)
"""Unit behind a speed."""
RANGE_SIGN_PATTERN = re.compile(r"(?<=\d)\s*(?:\.\.+|\u2026|[-\u2013\u2014])\s*(?=\d)")
"""Sign between the ends of a range: two dots, an ellipsis, a hyphen or a dash."""
SPEED_NAMES = "lowest speed in rpm", "highest speed in rpm"
"""Names of the ends in messages."""


def parse_speed_range(text: str) -> tuple[float, float]:
    """Parse the lowest and the highest spindle speed (rpm).

    Parameters
    ----------
    text
        Two speeds with a blank, a comma and a blank, a hyphen or two dots between them, with or without "rpm".

    Raises
    ------
    ValueError
        For another number of speeds, an implausible or ambiguous one, and a falling range. The message begins with
        the text that is wrong.

    Examples
    --------
    >>> parse_speed_range("1000 24000"), parse_speed_range("1,000-24,000 rpm")
    ((1000.0, 24000.0), (1000.0, 24000.0))
    """
    plausible = find_plausible_ranges(SpeedTable)
    limits = [(plausible[key].low, plausible[key].high) for key in ("low_rpm", "high_rpm")]
    bare = SPEED_UNIT_PATTERN.sub("", text.strip())
    ends = RANGE_SIGN_PATTERN.split(bare)
    low, high = read_numbers(ends, limits) if len(ends) == 2 else parse_numbers(bare, SPEED_NAMES, limits=limits)
    for name, speed, (least, most) in zip(SPEED_NAMES, (low, high), limits, strict=True):
        if not least <= speed <= most:
            raise ValueError(f"{text!r}: {name} is {speed:g}, outside {least:g} to {most:g}. Write speeds as 18000.")
    if not low < high:
        raise ValueError(f"{text!r}: low_rpm={low:g} is not below high_rpm={high:g}. Give the lowest speed first.")
    return low, high
