"""Numbers with a unit as people write them: `0.5in`, `1/2"`, `300 sfm`, `0.002 ipt`, `10 hp`."""

import re
from collections.abc import Mapping
from typing import Any

from lobewatch.machine.settings.number_text import (
    SEPARATED_NUMBER_PATTERN,
    list_readings,
    read_number,
    require_one_reading,
)

INCH_MM = 25.4
LENGTH_UNITS = {"mm": 1.0, "um": 1e-3, "µm": 1e-3, "cm": 10.0, "m": 1e3}
LENGTH_UNITS |= dict.fromkeys(("in", "inch", "inches", '"'), INCH_MM) | dict.fromkeys(("mil", "thou"), INCH_MM / 1e3)
"""Units of a length in mm."""
FEED_UNITS = LENGTH_UNITS | {"mm/tooth": 1.0, "ipt": INCH_MM, "in/tooth": INCH_MM}
"""Units of a feed per tooth in mm."""
SPEED_UNITS = {"m/min": 1.0} | dict.fromkeys(("sfm", "sfpm", "ft/min"), 0.3048)
"""Units of a cutting speed in m/min."""
POWER_UNITS = {"kW": 1.0, "W": 1e-3, "hp": 0.745699872}
"""Units of a power in kW; the mechanical horsepower is 550 ft lbf/s."""
UNITS_BY_KEY_END = {"feed_per_tooth_mm": FEED_UNITS, "_mm": LENGTH_UNITS, "_m_min": SPEED_UNITS, "_kw": POWER_UNITS}
"""Units of the value of a key, by the end of the key."""
NUMBER = rf"(?:(?P<whole>\d+)[ -](?=\d+/))?(?P<number>{SEPARATED_NUMBER_PATTERN})(?:/(?P<divisor>[1-9]\d*))?"
"""Number, or fraction with or without a whole number."""
QUANTITY_PATTERN = re.compile(rf"\s*{NUMBER}\s*(?P<unit>[^\d\s.,]\S*)\s*")


def read_quantity(text: str, units: Mapping[str, float]) -> float:
    """Read a number with a unit, and convert it to the unit with factor 1, rounded to 12 digits. A point is decimal.

    Raises ValueError for a text without a number and a unit, an unknown unit, and a number that may have two values.

    >>> read_quantity("1 1/2 in", LENGTH_UNITS), read_quantity("300 sfm", SPEED_UNITS)
    (38.1, 91.44)
    """
    match = QUANTITY_PATTERN.fullmatch(text)
    if match is None:
        raise ValueError(f"{text!r} is not a number with a unit. Write it as 12.5{next(iter(units))}.")
    factors = {name.casefold(): factor for name, factor in units.items()}
    if (unit := match["unit"].casefold()) not in factors:
        raise ValueError(f"unit {match['unit']!r} of {text!r} is unknown. Use {', '.join(units)}.")
    number = None if "," in match["number"] else read_number(match["number"], ".")
    if number is None:
        require_one_reading(match["number"])
        number = list_readings(match["number"])[0]
    number /= int(match["divisor"] or 1)
    return float(f"{(int(match['whole'] or 0) + number) * factors[unit]:.12g}")


def convert_unit_texts(value: Any, key: str = "") -> Any:
    """Convert the texts with a unit in tables of machine.toml to numbers in the unit of their key.

    Raises ValueError with the key for a unit of another kind.
    """
    if isinstance(value, Mapping):
        return {name: convert_unit_texts(one, name) for name, one in value.items()}
    if isinstance(value, list):
        return [convert_unit_texts(one, key) for one in value]
    units = next((units for end, units in UNITS_BY_KEY_END.items() if key.endswith(end)), None)
    if units is None or not isinstance(value, str) or QUANTITY_PATTERN.fullmatch(value) is None:
        return value
    try:
        return read_quantity(value, units)
    except ValueError as error:
        raise ValueError(f"{key}: {error}") from None
