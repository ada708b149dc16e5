"""From the DAQ to hits, averaged FRF and HDF5 files."""

from .atomic import atomic_write
from .channel import ACROSS, Block, Channel, SensorInput, TapDirection, tap_direction
from .dataq import DataqEmulator, DataqFaults, DataqSource, DataqTraits
from .devices import (
    Answer,
    DeviceSettings,
    Driver,
    PortSurvey,
    SeenPort,
    SensorPlace,
    check_settings,
    driver_names,
    find_driver,
    load_drivers,
    on_no_serial_port,
    probe_port,
    survey_ports,
)
from .emulation import Bench, EmulatorThread, HammeredStructure, Hammering, SimulatedSource, Structure
from .errors import DataError, DeviceError
from .estimation import (
    RunningMean,
    cross_spectra,
    estimate_frf,
    exponential_window,
    force_noise,
    hidden_window,
    infer_averages,
    is_smoothed,
    recorded_share,
    time_after_hit,
    time_of_hit,
    windowed_receptance,
    without_mass,
)
from .event import Event, EventKind
from .files.contents.contents import Contents, Signal
from .files.contents.description import Description
from .files.contents.ledger import Fact
from .files.contents.recording import Recording
from .files.contents.units import STANDARD_GRAVITY
from .files.convert import Converted, convert
from .files.file_source import FileSource
from .files.formats import known_formats
from .files.read_recording import look, read_frf, read_hits, read_recording
from .files.readers.format import Format
from .files.tap_file import read_tap, read_tap_hits, write_hit, write_tap
from .frf import Frf, from_accelerance
from .hit import Hit, HitFlags
from .hits import HitSearch, Trigger, capture_hits, free_decay, ring_down
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
    rate_doubt,
    stiffness_doubt,
    unit_mistake,
)
from .source import Device, DeviceAddress, DeviceIdentity, Source
from .tap import UNSAID, Circumstances, Conditions, SourceFile, TapTest, machine_of, named_in_id, new_tap_id
from .taps import Faults, TapsEmulator, TapsSource
from .verdicts import HitVerdict, average_good, check_hit, judge_hit

__all__ = [
    "ACROSS",
    "STANDARD_GRAVITY",
    "UNSAID",
    "Answer",
    "Bench",
    "Block",
    "Channel",
    "Circumstances",
    "Conditions",
    "Contents",
    "Converted",
    "DataError",
    "DataqEmulator",
    "DataqFaults",
    "DataqSource",
    "DataqTraits",
    "Description",
    "Device",
    "DeviceAddress",
    "DeviceError",
    "DeviceIdentity",
    "DeviceSettings",
    "Driver",
    "EmulatorThread",
    "Event",
    "EventKind",
    "Fact",
    "Faults",
    "FileSource",
    "Format",
    "Frf",
    "HammeredStructure",
    "Hammering",
    "Hit",
    "HitFlags",
    "HitSearch",
    "HitVerdict",
    "MassCalibration",
    "MeasuredRate",
    "MeasuredSkew",
    "PortInfo",
    "PortSurvey",
    "Recording",
    "Remark",
    "RunningMean",
    "SeenPort",
    "SensorInput",
    "SensorPlace",
    "Signal",
    "SimulatedSource",
    "Source",
    "SourceFile",
    "Structure",
    "TapDirection",
    "TapTest",
    "TapsEmulator",
    "TapsSource",
    "Trigger",
    "atomic_write",
    "average_good",
    "calibrate_by_mass",
    "calibration_doubt",
    "capture_hits",
    "channel_doubts",
    "check_hit",
    "check_name",
    "check_rate",
    "check_settings",
    "convert",
    "cross_spectra",
    "driver_names",
    "estimate_frf",
    "exponential_window",
    "find_driver",
    "find_port",
    "force_noise",
    "free_decay",
    "from_accelerance",
    "hidden_window",
    "infer_averages",
    "is_smoothed",
    "joined",
    "judge_hit",
    "known_formats",
    "list_ports",
    "load_drivers",
    "look",
    "machine_of",
    "measure_rate",
    "measure_skew",
    "named_in_id",
    "new_tap_id",
    "no_ports_hint",
    "on_no_serial_port",
    "probe_port",
    "rate_doubt",
    "read_frf",
    "read_hits",
    "read_recording",
    "read_tap",
    "read_tap_hits",
    "recorded_share",
    "ring_down",
    "stiffness_doubt",
    "survey_ports",
    "tap_direction",
    "time_after_hit",
    "time_of_hit",
    "unit_mistake",
    "usb_identity",
    "windowed_receptance",
    "without_mass",
    "write_hit",
    "write_tap",
]
