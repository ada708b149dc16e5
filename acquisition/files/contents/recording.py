"""Interpreted recorded file: hits or an FRF, the origin of each fact, and missing facts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from acquisition.errors import DataError
from acquisition.files.contents.column_headings import assign_columns, format_signal_names
from acquisition.files.contents.contents import (
    Contents,
    Description,
    Fact,
    ImportReport,
    Signal,
    parse_time_constant,
)
from acquisition.files.contents.resolve_frf import FRF_COLUMNS_EXAMPLE, find_frf_candidates, resolve_frf
from acquisition.files.contents.resolve_hits import HIT_COLUMNS_EXAMPLE, resolve_hits
from acquisition.frf import Frf
from acquisition.hit import Hit
from acquisition.tap_test import Conditions

ANY_COLUMNS_EXAMPLE = (
    f"{HIT_COLUMNS_EXAMPLE} for hits, with Description.rate if there is no time, "
    f"or Description.columns{FRF_COLUMNS_EXAMPLE} for an FRF, with Description.spacing if there is no frequency"
)
"""Example of the columns of either hits or an FRF."""

MIN_MODE_LINES = 4
"""Fewest lines of an FRF with a mode: with complex constant, mass and spring it has eight real unknowns."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Recorded file, understood as far as possible."""

    path: Path
    """File that was read."""
    title: str
    """Name of its format, for people."""
    hits: tuple[Hit, ...] = ()
    """Hits in SI units; empty if the file holds only an FRF, or where something is missing or wrong."""
    frf: Frf | None = None
    """FRF of the file; None without one, or where something is missing or wrong."""
    facts: tuple[Fact, ...] = ()
    """Known facts, each from the file, by option or by default."""
    problems: str = ""
    """Missing facts, with the fields of `Description` that state them, and errors; empty if there are none."""
    created: datetime | None = None
    """Time of recording (timezone-aware); None if unknown."""
    tool: str = ""
    """Name of the tool in the spindle; empty if unknown."""
    direction: str = ""
    """Direction at the tool tip; empty if unknown."""
    operator: str = ""
    """Name of the person with the hammer; empty if unknown."""
    device: str = ""
    """Recording device; empty if unknown."""
    conditions: Conditions | None = None
    """Conditions of the test; None if the file is not a tap file of lobewatch."""
    window: float | None = None
    """Time constant of the exponential window over the response (s); NaN if unknown, None without a window."""

    def require_valid(self) -> Recording:
        """Return this recording; raise DataError with all missing facts and faults."""
        if self.problems:
            raise DataError(f"{self.path}: {self.problems}")
        return self

    def require_measurable(self) -> Recording:
        """Return this recording; raise DataError as `require_valid`, and for an FRF of too few lines for any mode."""
        frf = self.require_valid().frf
        if frf is not None and frf.frequency.size < MIN_MODE_LINES:
            found = f"the FRF has {frf.frequency.size} lines, but one mode needs at least {MIN_MODE_LINES}"
            raise DataError(f"{self.path}: {found}. Export more frequency lines.")
        return self


def resolve_recording(path: Path, title: str, contents: Contents, description: Description) -> Recording:
    """Return the hits where the contents are only signals over time, else the FRF."""
    report = ImportReport(description)
    signals = assign_columns(contents.signals, report)
    contents = replace(contents, signals=signals)
    frf, hits = (None, []) if report.faults else _resolve_frf_or_hits(contents, report)
    if len(contents.machines) > 1:
        machines = ", ".join(contents.machines)
        found = f"the file has {len(contents.machines)} machines ({machines})"
        report.add_fault(found, "Export each machine to its own file")
    window = "" if hits and all(signal.is_before_window for signal in signals) else contents.window
    if window:
        report.add_fact("window", window)
    for note in contents.notes:
        report.add_fact("note", note)
    facts, problems = tuple(report.facts), report.format_problems()
    labels = contents.created, contents.tool, contents.direction
    return Recording(path, title, tuple(hits), frf, facts, problems, *labels, window=parse_time_constant(window))


def _resolve_frf_or_hits(contents: Contents, report: ImportReport) -> tuple[Frf | None, list[Hit]]:
    signals = contents.signals
    over_frequency = any(signal.role == "frequency" for signal in signals)
    if find_frf_candidates(signals) and (over_frequency or not _is_over_time(signals)):
        _reject_useless_fields(("rate", "full_scale", "force"), "an FRF, not signals over time", report)
        return resolve_frf(contents, report), []
    if not signals:
        report.add_fault("the file has no columns of numbers")
    elif over_frequency or not _is_over_time(signals):
        example = FRF_COLUMNS_EXAMPLE if over_frequency else ANY_COLUMNS_EXAMPLE
        report.add_missing(f"meaning of the columns {format_signal_names(signals)}", "columns", example)
    else:
        _reject_useless_fields(("averages",), "single hits, not an averaged FRF", report)
        _reject_useless_fields(("spacing", "start"), "signals over time, not an FRF", report)
        return None, resolve_hits(contents, report)
    return None, []


def _is_over_time(signals: Sequence[Signal]) -> bool:
    return any(one.role in ("time", "force", "response") or one.rate or one.per_full_scale for one in signals)


def _reject_useless_fields(names: Sequence[str], content: str, report: ImportReport) -> None:
    for name in names:
        if getattr(report.description, name) not in ((), None):
            report.reject_useless(name, None, f"the file has {content}")
