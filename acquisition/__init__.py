"""From the DAQ to hits, averaged FRF and HDF5 files."""

from acquisition.atomic import atomic_write
from acquisition.channel import Block, Channel, TapDirection, tap_direction
from acquisition.dataq import DataqEmulator, DataqFaults, DataqInput, DataqSource, DataqTraits
from acquisition.devices import DeviceIdentity, probe_port
from acquisition.emulation import HammeredStructure, Hammering, SimulatedSource, Structure
from acquisition.errors import DataError, DeviceError
from acquisition.estimation import RunningMean, cross_spectra, estimate_frf, force_noise
from acquisition.files import (
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
from acquisition.frf import Frf, from_accelerance
from acquisition.hit import Hit, HitFlags
from acquisition.hits import HitSearch, Trigger, capture_hits, ring_down
from acquisition.names import check_name
from acquisition.ports import PortInfo, find_port, list_ports, no_ports_hint, usb_identity
from acquisition.remark import Remark, joined
from acquisition.sensors import (
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
from acquisition.source import Source
from acquisition.tap import Circumstances, SourceFile, TapTest, new_tap_id
from acquisition.taps import Event, EventKind, Faults, TapsEmulator, TapsSource
from acquisition.verdicts import Verdict, average_good, check_hit, judge_hit

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
