"""From the DAQ to hits, averaged FRF and HDF5 files."""

from acquisition.atomic_write import atomic_write
from acquisition.capture_hits import Trigger, capture_hits
from acquisition.channel import Block, Channel
from acquisition.check_hit import check_hit
from acquisition.errors import DataError, DeviceError
from acquisition.estimate_frf import cross_spectra, estimate_frf
from acquisition.frf import Frf, from_accelerance
from acquisition.hammered_structure import HammeredStructure, Hammering, Structure
from acquisition.hit import Hit, HitFlags
from acquisition.judge_hit import judge_hit
from acquisition.mass_calibration import MassCalibration, calibrate_by_mass
from acquisition.measure_rate import MeasuredRate, check_rate, measure_rate
from acquisition.measure_skew import MeasuredSkew, measure_skew
from acquisition.plausibility import calibration_doubt, channel_doubts, stiffness_doubt, unit_mistake
from acquisition.read_recording import read_frf, read_hits, read_recording, recorded_as
from acquisition.simulated_source import SimulatedSource
from acquisition.source import Source
from acquisition.tap_file import read_tap, read_tap_hits, write_hit, write_tap
from acquisition.tap_test import Circumstances, SourceFile, TapTest, average_good, new_tap_id
from acquisition.taps_emulator import Faults, TapsEmulator
from acquisition.taps_source import TapsSource
from acquisition.verdict import Verdict

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
    "MassCalibration",
    "MeasuredRate",
    "MeasuredSkew",
    "SimulatedSource",
    "Source",
    "SourceFile",
    "Structure",
    "TapTest",
    "TapsEmulator",
    "TapsSource",
    "Trigger",
    "Verdict",
    "atomic_write",
    "average_good",
    "calibrate_by_mass",
    "calibration_doubt",
    "capture_hits",
    "channel_doubts",
    "check_hit",
    "check_rate",
    "cross_spectra",
    "estimate_frf",
    "from_accelerance",
    "judge_hit",
    "measure_rate",
    "measure_skew",
    "new_tap_id",
    "read_frf",
    "read_hits",
    "read_recording",
    "read_tap",
    "read_tap_hits",
    "recorded_as",
    "stiffness_doubt",
    "unit_mistake",
    "write_hit",
    "write_tap",
]
