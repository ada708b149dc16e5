"""The calibration that stands in the name of a device of The Modal Shop.

The name holds model, format, serial number, for each input the counts of a 24-bit converter per volt (format 2; format
3: 20 times as many) or per m/s^2 (format 1), and the date as yymmdd. Source: The Modal Shop, MAN-0343, USB audio
interface guide, 2021.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

MODEL = r"(?P<model>(?:485B|333D|633A|SDC0)\w\w)"
NAME = re.compile(MODEL + r".(?P<format>[123])(?P<serial>\w{6})(?P<counts>\d{14}|\d{10})(?P<date>\d{6})")


@dataclass(frozen=True)
class NameCalibration:
    """What stands in the name of a device of The Modal Shop."""

    model: str
    """Model."""
    serial: str
    """Serial number."""
    date: str
    """Date of the calibration (ISO 8601)."""
    full_scales: tuple[float, ...]
    """Full scale of each input (V; m/s^2 of a device that measures acceleration itself)."""
    is_accelerometer: bool
    """Whether it measures acceleration itself."""


def calibration_in(name: str) -> NameCalibration | None:
    """Calibration in the name of a device; None where there is none."""
    match = NAME.search(name)
    if match is None:
        return None
    kind, counts = match["format"], match["counts"]
    half = len(counts) // 2
    factor = 20 if kind == "3" else 1
    scales = tuple(2.0**23 / (factor * int(part)) for part in (counts[:half], counts[half:]))
    year, month, day = (int(match["date"][k : k + 2]) for k in (0, 2, 4))
    date = f"20{year:02d}-{month:02d}-{day:02d}"
    return NameCalibration(match["model"], match["serial"], date, scales, kind == "1")
