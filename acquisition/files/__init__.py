"""Tap tests as HDF5 files, and recordings of other programs."""

from acquisition.files.contents.contents import Contents, Signal
from acquisition.files.contents.description import Description
from acquisition.files.contents.ledger import Fact
from acquisition.files.contents.recording import Recording
from acquisition.files.contents.units import POUND_FORCE, STANDARD_GRAVITY
from acquisition.files.convert import Converted, convert
from acquisition.files.file_source import FileSource
from acquisition.files.formats import known_formats
from acquisition.files.read_recording import look, read_frf, read_hits, read_recording
from acquisition.files.readers.format import Format
from acquisition.files.tap_file import read_tap, read_tap_hits, write_hit, write_tap

__all__ = [
    "POUND_FORCE",
    "STANDARD_GRAVITY",
    "Contents",
    "Converted",
    "Description",
    "Fact",
    "FileSource",
    "Format",
    "Recording",
    "Signal",
    "convert",
    "known_formats",
    "look",
    "read_frf",
    "read_hits",
    "read_recording",
    "read_tap",
    "read_tap_hits",
    "write_hit",
    "write_tap",
]
