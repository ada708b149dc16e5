"""Boards that print their samples, as lines of text or as simple frames: format, source, probe, emulator."""

from .emulator import LinesEmulator, LinesTraits
from .frames import FrameFormat
from .printing import Printing
from .probe import probe_lines
from .source import LinesSource, check_lines

__all__ = [
    "FrameFormat",
    "LinesEmulator",
    "LinesSource",
    "LinesTraits",
    "Printing",
    "check_lines",
    "probe_lines",
]
