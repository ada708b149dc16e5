"""Description that a user gives of a recording, and the report of its import."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from datetime import datetime
from pathlib import Path
from typing import Literal, TypeVar

from acquisition.tap_test import UNKNOWN_CONDITIONS, Conditions

Result = TypeVar("Result")
_LABEL_FIELDS = ("date", "date_pattern", "tool", "direction", "conditions", "sensor", "without_force")


@dataclass(frozen=True)
class Description:
    """User's description of a recording; empty or None: no statement. It completes what the file does not state.

    A contradiction to the file is an error, except for `columns`, which replaces its headings.
    """

    columns: tuple[str, ...] = ()
    """Columns, in their order ("time [s]", "force [N]", "-") or by name ("frf [m/N]=H1", "frf=H:2")."""
    quantity: str = ""
    """Quantity of the response: displacement, velocity or acceleration."""
    unit: str = ""
    """Unit of the response (m/s^2, g, um), or of the FRF (m/N, g/N)."""
    force_unit: str = ""
    """Unit of the force (N, lbf)."""
    skip: int | None = None
    """Number of lines to skip above the rows of a text."""
    decimal: str = ""
    """Decimal sign of the numbers of a text, "comma" or "point"; the other one separates thousands."""
    spacing: float | None = None
    """Spacing of the lines of an FRF without frequencies (Hz)."""
    start: float | None = None
    """Frequency of its first line (Hz); None: 0."""
    force: Path | None = None
    """File with the force, where the recording has only the response; its columns follow those of the response."""
    rate: float | None = None
    """Sample rate (Hz)."""
    averages: int | None = None
    """Number of hits averaged in an FRF."""
    response: int | None = None
    """Number of the response to use where there are several, from 1."""
    full_scale: tuple[float, ...] = ()
    """Full scale of each channel in its unit, where values are shares of it."""
    sensitivity: tuple[str, ...] = ()
    """Sensitivity of each channel in volts: "2.25 mV/N", "10.2 mV/g"."""
    without_force: bool = False
    """True if no force was measured, so that only a response is needed."""
    sensor: str = "accelerometer"
    """Kind of sensor of a recorded cut: accelerometer or microphone."""
    tacho: str = ""
    """Name or number of the column of the spindle speed: the speed where its unit is rpm or Hz, else pulses."""
    pulses: int | None = None
    """Pulses of the tachometer per turn; None: 1."""
    date: datetime | None = None
    """Time of recording; local time where it has no zone."""
    date_pattern: str = ""
    """Pattern of the date in the file's name, as for strptime ("%Y%m%d"); with "/" in its path."""
    tool: str = ""
    """Name of the tool in the spindle."""
    direction: str = ""
    """Direction at the tool tip, x or y."""
    conditions: Conditions = UNKNOWN_CONDITIONS
    """Conditions of the test."""

    def list_signal_options(self) -> list[str]:
        """List the given fields that state something about the signals of the file."""
        names = [option.name for option in fields(self) if option.name not in _LABEL_FIELDS]
        return [f"Description.{name}" for name in names if getattr(self, name) not in ("", (), None)]


Origin = Literal["file", "option", "default"]


@dataclass(frozen=True)
class Fact:
    """Known fact of a recording."""

    name: str
    """Name of the fact: "sample rate", "unit", ..."""
    value: str
    """Value, as text for people."""
    origin: Origin
    """Origin: the file, an option of the user, or a default."""


class UnresolvedError(Exception):
    """Raised where a recording cannot be resolved; its report says what is missing or wrong."""


@dataclass
class ImportReport:
    """Facts, gaps and faults of a recording, collected while its contents are resolved.

    The methods that add a gap or a fault return an UnresolvedError, to raise where the rest needs what is missing.
    """

    description: Description
    """Description that a user gives of the recording."""
    facts: list[Fact] = field(default_factory=list)
    """Known facts."""
    missing: list[str] = field(default_factory=list)
    """Facts that the file does not state, each with the field of the description that states it."""
    faults: list[str] = field(default_factory=list)
    """Faults that prevent the import."""

    def add_fact(self, name: str, value: str, origin: Origin = "file") -> None:
        """Add a known fact."""
        self.facts.append(Fact(name, value, origin))

    def add_missing(self, fact: str, field_name: str, example: str = "") -> UnresolvedError:
        """Add a fact that is missing, and the field of the description that states it, with an example."""
        self.missing.append(f"{fact} (Description.{field_name}{example})")
        return UnresolvedError()

    def add_fault(self, fault: str) -> UnresolvedError:
        """Add a fault of the file."""
        self.faults.append(fault)
        return UnresolvedError()

    def reject(self, field_name: str, value: object, fault: str) -> UnresolvedError:
        """Add the fault of a field of the description and its value; None leaves the value out."""
        return self.add_fault(f"Description.{field_name}{'' if value is None else f' {value}'}: {fault}")

    def attempt(self, resolve: Callable[..., Result], *arguments: object) -> Result | None:
        """Return the result of a function of these arguments and this report; None where it cannot be resolved."""
        try:
            return resolve(*arguments, self)
        except UnresolvedError:
            return None

    def merge(self, other: ImportReport) -> None:
        """Add all entries of another report."""
        self.facts += other.facts
        self.missing += other.missing
        self.faults += other.faults

    def add_contradiction(self, field_name: str, given: object, in_file: object) -> UnresolvedError:
        """Add the fault of a field that differs from the file."""
        return self.reject(field_name, given, f"the file says {in_file}; leave the option out")

    @property
    def is_clean(self) -> bool:
        """True if nothing is missing or wrong."""
        return not self.missing and not self.faults

    def require_clean(self) -> None:
        """Raise UnresolvedError where something is missing or wrong."""
        if not self.is_clean:
            raise UnresolvedError

    def format_problems(self) -> str:
        """Return all that is missing and wrong; empty where nothing is."""
        missing = [f"it does not say: {', '.join(self.missing)}"] if self.missing else []
        return "; ".join([*self.faults, *missing])
