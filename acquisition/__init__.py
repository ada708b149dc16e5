"""From the DAQ to hits, averaged FRF and HDF5 files."""

from acquisition.atomic_write import atomic_write
from acquisition.capture_hits import Trigger, capture_hits
from acquisition.channel import Block, Channel
from acquisition.check_hit import check_hit
from acquisition.errors import DataError, DeviceError
from acquisition.estimate_frf import cross_spectra, estimate_frf
from acquisition.force_noise import force_noise
from acquisition.frf import Frf, from_accelerance
from acquisition.hammered_structure import HammeredStructure, Hammering, Structure
from acquisition.hit import Hit, HitFlags
from acquisition.read_recording import read_frf, read_hits, read_recording, recorded_as
from acquisition.simulated_source import SimulatedSource
from acquisition.source import Source
from acquisition.tap_file import read_tap, read_tap_hits, write_hit, write_tap
from acquisition.tap_test import Circumstances, SourceFile, TapTest, average_good, new_tap_id
from acquisition.taps_emulator import Faults, TapsEmulator
from acquisition.taps_source import TapsSource

__all__ = [
    "Block",
    "Channel",
    "Circumstances",
    "DataError",
    "DeviceError",
    "Faults",
    "Frf",
    "HammeredStructure",
    "Hammering",
    "Hit",
    "HitFlags",
    "SimulatedSource",
    "Source",
    "SourceFile",
    "Structure",
    "TapTest",
    "TapsEmulator",
    "TapsSource",
    "Trigger",
    "atomic_write",
    "average_good",
    "capture_hits",
    "check_hit",
    "cross_spectra",
    "estimate_frf",
    "force_noise",
    "from_accelerance",
    "new_tap_id",
    "read_frf",
    "read_hits",
    "read_recording",
    "read_tap",
    "read_tap_hits",
    "recorded_as",
    "write_hit",
    "write_tap",
]
