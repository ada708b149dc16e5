"""Interpreted recorded file: hits or an FRF, the origin of each fact, and missing facts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from acquisition.errors import DataError, Remark
from acquisition.files.contents.column_headings import assign_columns, format_signal_names
from acquisition.files.contents.contents import Contents, Description, Fact, ImportReport, Signal, parse_time_constant
from acquisition.files.contents.hit_layouts import (
    AXES,
    HitSignals,
    find_named_hits,
    find_stack,
    split_hits,
    suggest_axes,
    suggest_columns,
)
from acquisition.files.contents.join_hits import HIT_LEFT_OUT_CODE
from acquisition.files.contents.resolve_frf import FRF_COLUMNS_EXAMPLE, find_frf_candidates, resolve_frf
from acquisition.files.contents.resolve_hits import HIT_COLUMNS_EXAMPLE, infer_kind, resolve_hits, resolve_test
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
    remarks: tuple[Remark, ...] = ()
    """Remarks on hits and files that are left out."""
    window: float | None = None
    """Time constant of the exponential window over the response (s); NaN if unknown, None without a window."""

    units: tuple[str, ...] = ()
    """Units of force and response that the hits are converted from; only that of the response without a force."""
    places: tuple[str, ...] = ()
    """File and number of each hit in it, where the hits are of several files; empty otherwise."""

    @property
    def n_found(self) -> int:
        """Number of hits found, with those that are left out; 0 for an FRF."""
        return len(self.hits) + sum(remark.code == HIT_LEFT_OUT_CODE for remark in self.remarks)

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
    found = _resolve_contents(contents, report)
    layout = None if description.axes or description.one_test else _infer_layout(contents, found, report)
    if layout is not None:
        report = _ask_for_layout(contents, layout, report)
    groups = () if description.one_test else contents.groups
    for noun, names in (("machines", contents.machines), ("groups", groups)):
        if len(names) > 1:
            cure = "Export each machine to its own file"
            cure += ", or give Description.one_test if they are hits of one tap test" if noun == "groups" else ""
            report.add_fault(f"the file has {len(names)} {noun} ({', '.join(names)})", cure)
    is_before_window = bool(found.hits) and all(signal.is_before_window for signal in found.signals)
    window = "" if is_before_window else contents.window
    if window:
        report.add_fact("window", window)
    for note in contents.notes:
        report.add_fact("note", note)
    facts, problems = tuple(report.facts), report.format_problems()
    hits = () if problems else tuple(found.hits)
    labels = contents.created, contents.tool, contents.direction
    remarks = tuple(replace(remark, about=f"{path.name}, {remark.about}") for remark in report.remarks)
    recording = Recording(path, title, hits, found.frf, facts, problems, *labels, remarks=remarks)
    return replace(recording, window=parse_time_constant(window), units=tuple(report.units))


class _Resolved(NamedTuple):
    """FRF or hits found in the contents of a file."""

    signals: Sequence[Signal]
    """Signals with the roles and units of the description."""
    frf: Frf | None = None
    """FRF, if there is one."""
    hits: Sequence[Hit] = ()
    """Hits, if there are any."""


def _resolve_contents(contents: Contents, report: ImportReport) -> _Resolved:
    if not contents.signals:
        report.add_fault("the file has no columns of numbers")
        return _Resolved(())
    by_columns = ImportReport(report.description)
    signals = assign_columns(contents.signals, by_columns)
    if _holds_frf(signals):
        _reject_useless_fields(("rate", "full_scale", "force", "axes"), "an FRF, not signals over time", report)
        report.merge(by_columns)
        return _Resolved(signals, resolve_frf(replace(contents, signals=signals), report) if report.is_clean else None)
    if report.description.axes or report.description.one_test:
        found = report.attempt(split_hits, contents.signals) or []
        return _Resolved(signals, hits=_resolve_test(found, report) if found else ())
    report.merge(by_columns)
    return _Resolved(signals, hits=() if report.faults else _resolve_signals(contents, signals, report))


def _resolve_signals(contents: Contents, signals: Sequence[Signal], report: ImportReport) -> list[Hit]:
    """Return the hits of signals that are no FRF."""
    over_frequency = any(signal.role == "frequency" for signal in signals)
    if not signals:
        report.add_fault("the file has no columns of numbers")
    elif over_frequency or not _is_over_time(signals):
        example = FRF_COLUMNS_EXAMPLE if over_frequency else ANY_COLUMNS_EXAMPLE
        report.add_missing(f"meaning of the columns {format_signal_names(signals)}", "columns", example)
    else:
        _reject_frf_fields(report)
        return resolve_hits(replace(contents, signals=tuple(signals)), report)
    return []


def _resolve_test(found: Sequence[HitSignals], report: ImportReport) -> list[Hit]:
    """Return the hits of one tap test."""
    _reject_frf_fields(report)
    first = found[0]
    if first.report.is_clean and not _has_known_kinds(first.signals, report.description):
        names, example = format_signal_names(first.signals), f' "{suggest_columns(first.signals)}"'
        report.add_missing(f"meaning of the columns {names} of each hit", "columns", example)
        has_rate = any(signal.rate or signal.role == "time" for signal in first.signals)
        if not has_rate and report.description.rate is None:
            report.add_missing("sample rate if no column is the time", "rate", " 51200")
    return [] if report.missing else resolve_test(found, report)


def _has_known_kinds(signals: Sequence[Signal], description: Description) -> bool:
    """Return whether the kinds of the needed channels are known, or no channel of unknown kind can be one of them."""
    kinds = [infer_kind(signal) for signal in signals if signal.role != "time"]
    needed = {"response"} if description.without_force else {"force", "response"}
    return needed <= set(kinds) or "" not in kinds


def _infer_layout(contents: Contents, found: _Resolved, report: ImportReport) -> Description | None:
    """Return the description of hits in an array, in groups or in numbered channels; None if there are none."""
    stack = find_stack(found.signals)
    if found.frf is not None or _holds_frf(found.signals):
        return None
    if stack is not None and stack.array is not None and (not found.hits or infer_kind(stack)):
        if stack.array.ndim > len(AXES):
            fault = f"{_format_array(stack)} has {stack.array.ndim} axes"
            report.add_fault(fault, "Save an array with only the axes hits, channels and samples")
            return None
        return replace(report.description, axes=suggest_axes(stack.array))
    if report.is_clean:
        return None
    named = find_named_hits(contents.signals, needs_force=not report.description.without_force)
    may_be_hits = named is not None and (named.is_likely or not report.description.columns)
    return replace(report.description, one_test=True) if may_be_hits else None


def _ask_for_layout(contents: Contents, layout: Description, report: ImportReport) -> ImportReport:
    """Return a report with the layout of the hits as the missing fact, and what else is missing with it."""
    asked, trial = ImportReport(report.description), ImportReport(layout)
    _resolve_contents(contents, trial)
    if layout.axes:
        stacks = [one for one in contents.signals if one.array is not None and one.array.ndim == len(AXES)]
        names = ", ".join(dict.fromkeys(map(_format_array, stacks)))
        asked.add_missing(f"order of the axes of {names}", "axes", f" {','.join(layout.axes)}")
    else:
        asked.add_missing("use of all hits of the file as one tap test", "one_test")
        asked.missing[0] += "".join(f", or {choice}," for choice in report.missing[:1])
        asked.faults += [] if report.missing else report.faults
    asked.merge(trial)
    return asked


def _format_array(column: Signal) -> str:
    """Return the name and the shape of the array of a column."""
    return (
        f"{column.name.rpartition(':')[0]} ({' x '.join(map(str, () if column.array is None else column.array.shape))})"
    )


def _holds_frf(signals: Sequence[Signal]) -> bool:
    over_frequency = any(signal.role == "frequency" for signal in signals)
    return bool(find_frf_candidates(signals)) and (over_frequency or not _is_over_time(signals))


def _is_over_time(signals: Sequence[Signal]) -> bool:
    return any(one.role in ("time", "force", "response") or one.rate or one.per_full_scale for one in signals)


def _reject_useless_fields(names: Sequence[str], content: str, report: ImportReport) -> None:
    for name in names:
        if getattr(report.description, name) not in ((), None):
            report.reject_useless(name, None, f"the file has {content}")


def _reject_frf_fields(report: ImportReport) -> None:
    _reject_useless_fields(("averages",), "single hits, not an averaged FRF", report)
    _reject_useless_fields(("spacing", "start"), "signals over time, not an FRF", report)
