"""Tap test in, stability lobes out: which cuts stop being safe as a spindle ages.

`Logbook.open(folder)` is the way in for programs: the tap tests of one machine and all that follows from them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lobewatch.analysis import Logbook

__all__ = ["Logbook"]


def __getattr__(name: str) -> Any:
    """Import it when it is first asked for: the command line starts without the numbers behind it."""
    if name == "Logbook":
        from lobewatch.analysis import Logbook

        return Logbook
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
