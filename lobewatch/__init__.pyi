"""Tap test in, stability lobes out: which cuts stop being safe as a spindle ages.

`Logbook.open(folder)` is the way in for programs: the tap tests of one machine and all that follows from them.
"""

from .logbook import Logbook

__all__ = ["Logbook"]
