"""After a command has altered a machine: its standing beside it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from lobewatch.analysis import Logbook
from lobewatch.analysis.plant.summarise import summarise


def tell(logbook: Logbook) -> None:
    """Make the standing and keep it; nothing is raised, for what was to be stored is stored already."""
    try:
        summarise(logbook if logbook.is_current else Logbook.open(logbook.folder.path))
    except (ValueError, OSError, ArithmeticError, LookupError):
        return  # whoever looks at the machine next is told why


@contextmanager
def telling(logbook: Logbook) -> Iterator[None]:
    """The same at the end of work that may store something and then find fault with the rest."""
    before = logbook.folder.mark
    try:
        yield
    except (ValueError, OSError):
        if logbook.folder.mark != before:
            tell(logbook)
        raise
    if logbook.folder.mark != before:
        tell(logbook)
