"""From the DAQ to hits, averaged FRF and HDF5 files."""

from .atomic import atomic_write
from .channel import Block, Channel, TapDirection, tap_direction
from .dataq import DataqEmulator, DataqFaults, DataqInput, DataqSource, DataqTraits
from .devices import DeviceIdentity, probe_port
from .emulation import HammeredStructure, Hammering, SimulatedSource, Structure
from .errors import DataError, DeviceError
from .estimation import RunningMean, cross_spectra, estimate_frf, force_noise
from .files import (
    STANDARD_GRAVITY,
    FileSource,
    Format,
    known_formats,
    read_frf,
    read_hits,
    read_recording,
    read_tap,
    read_tap_hits,
    recorded_as,
    write_hit,
    write_tap,
)
from .frf import Frf, from_accelerance
from .hit import Hit, HitFlags
from .hits import HitSearch, Trigger, capture_hits, ring_down
from .names import check_name
from .ports import PortInfo, find_port, list_ports, no_ports_hint, usb_identity
from .remark import Remark, joined
from .sensors import (
    MassCalibration,
    MeasuredRate,
    MeasuredSkew,
    calibrate_by_mass,
    calibration_doubt,
    channel_doubts,
    check_rate,
    measure_rate,
    measure_skew,
    stiffness_doubt,
    unit_mistake,
)
from .source import Source
from .tap import Circumstances, SourceFile, TapTest, new_tap_id
from .taps import Event, EventKind, Faults, TapsEmulator, TapsSource
from .verdicts import Verdict, average_good, check_hit, judge_hit

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
    "Format",
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
    "TapDirection",
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
    "check_name",
    "check_rate",
    "cross_spectra",
    "estimate_frf",
    "find_port",
    "force_noise",
    "from_accelerance",
    "joined",
    "judge_hit",
    "known_formats",
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
    "tap_direction",
    "unit_mistake",
    "usb_identity",
    "write_hit",
    "write_tap",
]
