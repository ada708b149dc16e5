"""Memory that a report or a tap test needs for a moment, given back to the system."""

from __future__ import annotations

import ctypes
import sys


def return_memory() -> None:
    """Give back what is free between what is in use.

    The C library of Linux keeps such memory for each thread that has once needed it; it never grows out of bounds, but
    by half of what is in use within a few dozen reports. Elsewhere nothing is done.
    """
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # of glibc alone
        if trim is not None:
            trim(0)
