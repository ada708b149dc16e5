"""Tap tests as HDF5 files, and recordings of other programs."""

from acquisition.files.file_source import FileSource
from acquisition.files.format import Format
from acquisition.files.formats import known_formats
from acquisition.files.read_recording import read_frf, read_hits, read_recording, recorded_as
from acquisition.files.tap_file import read_tap, read_tap_hits, write_hit, write_tap
from acquisition.files.units import FACTORS, STANDARD_GRAVITY

__all__ = [
    "FACTORS",
    "STANDARD_GRAVITY",
    "FileSource",
    "Format",
    "known_formats",
    "read_frf",
    "read_hits",
    "read_recording",
    "read_tap",
    "read_tap_hits",
    "recorded_as",
    "write_hit",
    "write_tap",
]
