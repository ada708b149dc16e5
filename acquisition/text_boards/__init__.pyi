"""Boards that print their samples as lines of text or simple frames: decoders, source, emulator."""

from .decoders import FrameFormat, OutputFormat
from .emulator import TextBoardEmulator, TextBoardTraits
from .source import TextBoardSource, check_text_board, probe_text_board

__all__ = [
    "FrameFormat",
    "OutputFormat",
    "TextBoardEmulator",
    "TextBoardSource",
    "TextBoardTraits",
    "check_text_board",
    "probe_text_board",
]
