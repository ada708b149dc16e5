"""A recorded file as it is understood: hits or an FRF, where each fact is from, and what is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from acquisition.errors import DataError
from acquisition.files.contents.column_headings import assign_columns, format_signal_names
from acquisition.files.contents.contents import Contents, Signal, parse_time_constant
from acquisition.files.contents.description import Description, Fact, ImportReport
from acquisition.files.contents.resolve_frf import FRF_COLUMNS_EXAMPLE, find_frf_candidates, resolve_frf
from acquisition.files.contents.resolve_hits import HIT_COLUMNS_EXAMPLE, resolve_hits
from acquisition.frf import Frf
from acquisition.hit import Hit
from acquisition.tap_test import Conditions

ANY_COLUMNS_EXAMPLE = (
    f"{HIT_COLUMNS_EXAMPLE}, those of --force FILE where the force stands in another file behind them; or {FRF_COLUMNS_EXAMPLE}, "
    "without time where --rate says it, without frequency where --spacing does"
)
"""How any of both is named."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A recorded file, understood as far as it can be."""

    path: Path
    """File it was read from."""
    title: str
    """Name of its format, for people."""
    hits: tuple[Hit, ...] = ()
    """Hits in SI units; empty where it holds only an FRF, or where something is missing or wrong."""
    frf: Frf | None = None
    """The FRF that it holds; None where there is none, or where something is missing or wrong."""
    facts: tuple[Fact, ...] = ()
    """Facts that are known, each from the file, by option or by default."""
    problems: str = ""
    """Text on what is missing, with the options that say it, and what is wrong; empty where nothing is."""
    created: datetime | None = None
    """Time of recording, where the file says so (timezone-aware)."""
    tool: str = ""
    """Name of the tool in the spindle, where the file says so."""
    direction: str = ""
    """Direction at the tool tip, where the file says so."""
    operator: str = ""
    """Name of the person who held the hammer, where the file says so."""
    device: str = ""
    """Recording device, where the file says so."""
    conditions: Conditions | None = None
    """Conditions it was taken under; None where it is no tap file of ours."""
    window: float | None = None
    """Time constant (s) of the exponential window over the response that the file names; NaN where it does not say how
    its window falls, None where there is none."""

    def require_valid(self) -> Recording:
        """Itself; DataError with all that is missing or wrong."""
        if self.problems:
            raise DataError(f"{self.path}: {self.problems}")
        return self


def resolve_recording(path: Path, title: str, contents: Contents, description: Description) -> Recording:
    """Hits where signals over time are all there is, else the FRF."""
    report = ImportReport()
    signals = assign_columns(contents.signals, description.columns, report) if description.columns else contents.signals
    contents = replace(contents, signals=signals)
    frf, hits = (None, []) if report.faults else _resolve_frf_or_hits(contents, description, report)
    if len(contents.machines) > 1:
        report.faults.append(f"it holds {', '.join(contents.machines)}, not one machine; export each by itself")
    window = "" if hits and all(signal.is_before_window for signal in signals) else contents.window
    if window:
        report.add_fact("window", window)
    for note in contents.notes:
        report.add_fact("note", note)
    return Recording(
        path,
        title,
        tuple(hits),
        frf,
        tuple(report.facts),
        report.format_problems(),
        contents.created,
        contents.tool,
        contents.direction,
        window=parse_time_constant(window),
    )


def _resolve_frf_or_hits(
    contents: Contents, description: Description, report: ImportReport
) -> tuple[Frf | None, list[Hit]]:
    """Neither where something is missing or wrong, which the report then says."""
    signals = contents.signals
    over_frequency = any(signal.role == "frequency" for signal in signals)
    if find_frf_candidates(signals) and (over_frequency or not _is_over_time(signals)):
        _report_useless_options(description, ("rate", "full_scale", "force"), "an FRF", report)
        return resolve_frf(contents, description, report), []
    if not signals:
        report.faults.append("it holds no columns of numbers")
    elif over_frequency or not _is_over_time(signals):
        report.add_missing(
            f"what its columns are ({format_signal_names(signals)})",
            FRF_COLUMNS_EXAMPLE if over_frequency else ANY_COLUMNS_EXAMPLE,
        )
    else:
        _report_useless_options(description, ("averages",), "hits, and they are counted", report)
        _report_useless_options(description, ("spacing", "start"), "signals over time", report)
        return None, resolve_hits(contents, description, report)
    return None, []


def _is_over_time(signals: Sequence[Signal]) -> bool:
    over_time = any(signal.role in ("time", "force", "response") or signal.rate for signal in signals)
    return over_time or any(signal.per_full_scale for signal in signals)


def _report_useless_options(description: Description, names: Sequence[str], content: str, report: ImportReport) -> None:
    """Options that say nothing of what the file holds."""
    for name in names:
        if getattr(description, name) not in ((), None):
            report.faults.append(f"--{name.replace('_', '-')}: the file holds {content}; leave the option out")
