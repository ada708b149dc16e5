"""A recorded file as it is understood: hits or an FRF, where each fact is from, and what is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from acquisition.errors import DataError
from acquisition.files.contents.contents import Contents, Signal
from acquisition.files.contents.description import Description
from acquisition.files.contents.exponential import time_constant_of
from acquisition.files.contents.ledger import Fact, Ledger
from acquisition.files.contents.named_columns import named_columns, names_of
from acquisition.files.contents.settle_frf import COLUMNS_FRF, candidates, settle_frf
from acquisition.files.contents.settle_hits import COLUMNS_HIT, settle_hits
from acquisition.frf import Frf
from acquisition.hit import Hit
from acquisition.tap import Conditions

COLUMNS_ANY = (
    f"{COLUMNS_HIT}, those of --force FILE where the force stands in another file behind them; or {COLUMNS_FRF}, "
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
    complaint: str = ""
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

    def checked(self) -> Recording:
        """Itself; DataError with all that is missing or wrong."""
        if self.complaint:
            raise DataError(f"{self.path}: {self.complaint}")
        return self


def understood(path: Path, title: str, contents: Contents, description: Description) -> Recording:
    """Hits where signals over time are all there is, else the FRF."""
    ledger = Ledger()
    signals = named_columns(contents.signals, description.columns, ledger) if description.columns else contents.signals
    contents = replace(contents, signals=signals)
    frf, hits = (None, []) if ledger.faults else _frf_or_hits(contents, description, ledger)
    if len(contents.machines) > 1:
        ledger.faults.append(f"it holds {', '.join(contents.machines)}, not one machine; export each by itself")
    window = "" if hits and all(signal.is_before_window for signal in signals) else contents.window
    if window:
        ledger.know("window", window)
    for note in contents.notes:
        ledger.know("note", note)
    return Recording(
        path,
        title,
        tuple(hits),
        frf,
        tuple(ledger.facts),
        ledger.complaint(),
        contents.created,
        contents.tool,
        contents.direction,
        window=time_constant_of(window),
    )


def _frf_or_hits(contents: Contents, description: Description, ledger: Ledger) -> tuple[Frf | None, list[Hit]]:
    """Neither where something is missing or wrong, which the ledger then says."""
    signals = contents.signals
    over_frequency = any(signal.role == "frequency" for signal in signals)
    if candidates(signals) and (over_frequency or not _is_over_time(signals)):
        _useless(description, ("rate", "full_scale", "force"), "an FRF", ledger)
        return settle_frf(contents, description, ledger), []
    if not signals:
        ledger.faults.append("it holds no columns of numbers")
    elif over_frequency or not _is_over_time(signals):
        ledger.ask(f"what its columns are ({names_of(signals)})", COLUMNS_FRF if over_frequency else COLUMNS_ANY)
    else:
        _useless(description, ("averages",), "hits, and they are counted", ledger)
        _useless(description, ("spacing", "start"), "signals over time", ledger)
        return None, settle_hits(contents, description, ledger)
    return None, []


def _is_over_time(signals: Sequence[Signal]) -> bool:
    over_time = any(signal.role in ("time", "force", "response") or signal.rate for signal in signals)
    return over_time or any(signal.per_full_scale for signal in signals)


def _useless(description: Description, names: Sequence[str], content: str, ledger: Ledger) -> None:
    """Options that say nothing of what the file holds."""
    for name in names:
        if getattr(description, name) not in ((), None):
            ledger.faults.append(f"--{name.replace('_', '-')}: the file holds {content}; leave the option out")
