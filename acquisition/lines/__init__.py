"""Boards that print their samples, as lines of text or as simple frames: format, source, probe, emulator."""

from acquisition.lines.emulator import LinesEmulator, LinesTraits
from acquisition.lines.frames import FrameFormat
from acquisition.lines.printing import Printing
from acquisition.lines.probe import probe_lines
from acquisition.lines.source import LinesSource, check_lines

__all__ = ["FrameFormat", "LinesEmulator", "LinesSource", "LinesTraits", "Printing", "check_lines", "probe_lines"]
