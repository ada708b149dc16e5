"""Tap test in, stability lobes out: which cuts stop being safe as a spindle ages.

`Logbook.open(folder)` is the way in for programs: the tap tests of one machine and all that follows from them.
"""

import lazy_loader

from lobewatch.foreign_packages import guard_imports

guard_imports()
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
