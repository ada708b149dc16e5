"""Memory that a report or a tap test needs for a moment, given back to the system."""

from __future__ import annotations

import ctypes
import gc
import sys


def return_memory() -> None:
    """Give back what nobody refers to any more, and what lies free between what is in use.

    Pictures are circles of objects, which Python keeps until it has made as many others; the C library of Linux keeps
    what is free for each thread that has once needed it. Together that is 50 MB and more after a few dozen reports.
    """
    gc.collect()
    if sys.platform == "linux":
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)  # of glibc alone
        if trim is not None:
            trim(0)
