"""Units of texts, tables and figures for people: metric, or inches with `[machine] units = "inch"`.

JSON, CSV and machine.toml stay in the units that their keys name.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Literal, NamedTuple

from lobewatch.machine.settings.toml import parse_toml_tables, read_toml_text
from lobewatch.machine.settings.unit_text import FEED_UNITS, INCH_MM, SPEED_UNITS

UnitSystem = Literal["metric", "inch"]
"""Units of a shop."""
_SYSTEM: ContextVar[UnitSystem] = ContextVar("system", default="metric")
_IS_METRIC_OUTPUT: ContextVar[bool] = ContextVar("is_metric_output", default=False)


class Quantity(NamedTuple):
    """Quantity that people measure in other units in an inch shop."""

    metric_unit: str
    inch_unit: str
    inch_factor: float
    """Number of metric units in one inch unit."""
    decimals: int
    """Decimals of a value in the inch unit."""

    @property
    def unit(self) -> str:
        """Shown unit."""
        return self.inch_unit if shows_inches() else self.metric_unit

    @property
    def scale(self) -> float:
        """Number of shown units in one metric unit."""
        return 1 / self.inch_factor if shows_inches() else 1.0

    def number(self, value: float, form: str) -> str:
        """Format a metric value in the shown unit, without the unit; form: format in the metric unit.

        >>> with shown_units("inch"):
        ...     LENGTH.number(2.0, "g"), LENGTH.number(2.54, ".2f")
        ('0.0787', '0.1000')
        """
        if not shows_inches():
            return f"{value:{form}}"
        text = f"{value * self.scale:.{self.decimals}f}"
        return text.rstrip("0").rstrip(".") if form.endswith("g") and "." in text else text

    def round_down(self, value: float) -> float:
        """Round a metric value down to one that has no more than the shown decimals in inches."""
        steps = self.inch_factor / 10**self.decimals
        return math.floor(value / steps + 1e-9) * steps if shows_inches() else value

    def text(self, value: float, form: str = "g") -> str:
        """Format a metric value in the shown unit, with the unit; form: format in the metric unit."""
        return f"{self.number(value, form)} {self.unit}"

    def text_at_most(self, value: float, form: str = "g") -> str:
        """Format a metric value that must not be exceeded: `text`, rounded down in inches."""
        return self.text(self.round_down(value), form)


LENGTH = Quantity("mm", "in", INCH_MM, 4)
FEED_PER_TOOTH = Quantity("mm", "in", INCH_MM, 5)
FEED_RATE = Quantity("mm/min", "in/min", INCH_MM, 1)
CUTTING_SPEED = Quantity("m/min", "sfm", SPEED_UNITS["sfm"], 0)
REMOVAL_RATE = Quantity("cm3/min", "in3/min", (INCH_MM / 10) ** 3, 2)


def shows_inches() -> bool:
    """Return whether texts for people show inches now."""
    return _SYSTEM.get() == "inch" and not _IS_METRIC_OUTPUT.get()


def reads_inches() -> bool:
    """Return whether lengths without a unit that people enter are inches now."""
    return _SYSTEM.get() == "inch"


def length_units() -> dict[str, float]:
    """Return the factor (mm) of each unit of a length that people enter, "" without a unit."""
    return {"": INCH_MM if reads_inches() else 1.0} | FEED_UNITS


def length_argument(value_mm: float, form: str) -> str:
    """Format a length for a command line, with its unit in an inch shop."""
    return f"{value_mm:{form}}" + ("mm" if reads_inches() else "")


@contextmanager
def shown_units(system: UnitSystem) -> Iterator[None]:
    """Enter and show lengths in the units of a shop."""
    token = _SYSTEM.set(system)
    try:
        yield
    finally:
        _SYSTEM.reset(token)


@contextmanager
def metric_output() -> Iterator[None]:
    """Show all texts in metric units, as in JSON."""
    token = _IS_METRIC_OUTPUT.set(True)
    try:
        yield
    finally:
        _IS_METRIC_OUTPUT.reset(token)


def read_units(folder: Path) -> UnitSystem:
    """Read the units of a machine folder; metric if there is no sound machine.toml."""
    try:
        text = read_toml_text(folder / "machine.toml")
        units = parse_toml_tables(text)["machine"]["units"] if "units" in text else "metric"
    except (OSError, ValueError, LookupError, TypeError):
        return "metric"
    return "inch" if units == "inch" else "metric"
