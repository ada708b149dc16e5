"""From the DAQ to hits, averaged FRF and HDF5 files."""

from acquisition.atomic_write import atomic_write
from acquisition.average_good import average_good
from acquisition.capture_hits import HitSearch, Trigger, capture_hits
from acquisition.channel import Block, Channel
from acquisition.check_hit import check_hit
from acquisition.dataq import DataqInput
from acquisition.dataq_emulator import DataqEmulator, DataqFaults, DataqTraits
from acquisition.dataq_source import DataqSource
from acquisition.errors import DataError, DeviceError
from acquisition.estimate_frf import cross_spectra, estimate_frf
from acquisition.file_source import FileSource
from acquisition.find_port import find_port, usb_identity
from acquisition.force_noise import force_noise
from acquisition.frf import Frf, from_accelerance
from acquisition.hammered_structure import HammeredStructure, Hammering, Structure
from acquisition.hit import Hit, HitFlags
from acquisition.judge_hit import judge_hit
from acquisition.list_ports import PortInfo, list_ports
from acquisition.mass_calibration import MassCalibration, calibrate_by_mass
from acquisition.measure_rate import MeasuredRate, check_rate, measure_rate
from acquisition.measure_skew import MeasuredSkew, measure_skew
from acquisition.plausibility import calibration_doubt, channel_doubts, stiffness_doubt, unit_mistake
from acquisition.port_hints import no_ports_hint
from acquisition.probe_port import DeviceIdentity, probe_port
from acquisition.read_recording import read_frf, read_hits, read_recording, recorded_as
from acquisition.remark import Remark, joined
from acquisition.ring_down import ring_down
from acquisition.running_mean import RunningMean
from acquisition.simulated_source import SimulatedSource
from acquisition.source import Source
from acquisition.tap_file import read_tap, read_tap_hits, write_hit, write_tap
from acquisition.tap_test import Circumstances, SourceFile, TapTest, new_tap_id
from acquisition.taps_emulator import TapsEmulator
from acquisition.taps_event import Event, EventKind
from acquisition.taps_faults import Faults
from acquisition.taps_source import TapsSource
from acquisition.units import STANDARD_GRAVITY
from acquisition.verdict import Verdict

__all__ = [
    "STANDARD_GRAVITY",
    "Block",
    "Channel",
    "Circumstances",
    "DataError",
    "DataqEmulator",
    "DataqFaults",
    "DataqInput",
    "DataqSource",
    "DataqTraits",
    "DeviceError",
    "DeviceIdentity",
    "Event",
    "EventKind",
    "Faults",
    "FileSource",
    "Frf",
    "HammeredStructure",
    "Hammering",
    "Hit",
    "HitFlags",
    "HitSearch",
    "MassCalibration",
    "MeasuredRate",
    "MeasuredSkew",
    "PortInfo",
    "Remark",
    "RunningMean",
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
    "find_port",
    "force_noise",
    "from_accelerance",
    "joined",
    "judge_hit",
    "list_ports",
    "measure_rate",
    "measure_skew",
    "new_tap_id",
    "no_ports_hint",
    "probe_port",
    "read_frf",
    "read_hits",
    "read_recording",
    "read_tap",
    "read_tap_hits",
    "recorded_as",
    "ring_down",
    "stiffness_doubt",
    "unit_mistake",
    "usb_identity",
    "write_hit",
    "write_tap",
]
