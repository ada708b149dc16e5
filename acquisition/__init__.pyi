"""Data acquisition: devices, hits, averaged FRFs, HDF5 files and imported recordings."""

from .channel import CROSS_TAP, Block, Channel, SensorInput, TapDirection, parse_direction
from .dataq.emulator import DataqEmulator, DataqFaults, DataqTraits
from .dataq.source import DataqSource
from .devices.drivers import DeviceSettings, Driver, SensorDataLocation, skip_serial_probe
from .devices.port_scan import DeviceAnswer, PortScan, ScannedPort, probe_port, scan_ports
from .devices.registry import check_settings, find_driver, list_driver_names, load_drivers
from .emulation import EmulationSetup, EmulatorThread, HammeredStructure, Hammering, SimulatedSource, Structure
from .errors import DataError, DeviceError, Remark, check_name, merge_remarks
from .estimation.estimate_frf import RunningMean, compute_cross_spectra, estimate_frf, propagate_force_noise
from .estimation.frf_corrections import (
    apply_exponential_window,
    correct_windowed_receptance,
    find_hit_time,
    infer_averages,
    infer_recorded_share,
    infer_window,
    is_smoothed,
    measure_time_after_hit,
    remove_sensor_mass,
)
from .estimation.response_delay import remove_frf_delay, remove_hit_delay
from .file_io import atomic_write
from .files.contents.contents import Contents, Description, Fact, Format, Signal
from .files.contents.recording import Recording
from .files.contents.units import STANDARD_GRAVITY
from .files.convert import Conversion, convert
from .files.file_source import FileSource
from .files.read_recording import inspect_file, list_formats, list_frf_points, read_frf, read_hits, read_recording
from .files.tap_file import read_tap, read_tap_hits, write_hit, write_tap
from .frf import Frf, FrfPoints, from_accelerance
from .hit import Hit
from .hit_fault import HitFlags
from .hit_quality.evaluate_hit import HitVerdict, average_good_hits, check_hit, evaluate_hit
from .hits.capture_hits import HitSearch, Trigger, capture_hits
from .hits.free_decay import estimate_decay_time, extract_free_decay
from .ports.serial_ports import PortInfo, explain_no_ports, find_usb_identity, find_usb_port, list_serial_ports
from .sensors.daq_timing import MeasuredRate, MeasuredSkew, check_rate, measure_rate, measure_skew, rate_remark
from .sensors.mass_calibration import MassCalibration, calibrate_by_mass
from .sensors.plausibility import calibration_remark, channel_remarks, stiffness_remark, unit_mistake_remark
from .source import Device, DeviceAddress, DeviceIdentity, Event, EventKind, Source
from .tap_test import (
    UNKNOWN_CONDITIONS,
    Circumstances,
    Conditions,
    HitDecision,
    SourceFile,
    TapTest,
    new_tap_id,
    parse_machine_name,
    sanitize_id_part,
)
from .taps.emulator import TapsEmulator, TapsFaults
from .taps.source import TapsSource

__all__ = [
    "CROSS_TAP",
    "STANDARD_GRAVITY",
    "UNKNOWN_CONDITIONS",
    "Block",
    "Channel",
    "Circumstances",
    "Conditions",
    "Contents",
    "Conversion",
    "DataError",
    "DataqEmulator",
    "DataqFaults",
    "DataqSource",
    "DataqTraits",
    "Description",
    "Device",
    "DeviceAddress",
    "DeviceAnswer",
    "DeviceError",
    "DeviceIdentity",
    "DeviceSettings",
    "Driver",
    "EmulationSetup",
    "EmulatorThread",
    "Event",
    "EventKind",
    "Fact",
    "FileSource",
    "Format",
    "Frf",
    "FrfPoints",
    "HammeredStructure",
    "Hammering",
    "Hit",
    "HitDecision",
    "HitFlags",
    "HitSearch",
    "HitVerdict",
    "MassCalibration",
    "MeasuredRate",
    "MeasuredSkew",
    "PortInfo",
    "PortScan",
    "Recording",
    "Remark",
    "RunningMean",
    "ScannedPort",
    "SensorDataLocation",
    "SensorInput",
    "Signal",
    "SimulatedSource",
    "Source",
    "SourceFile",
    "Structure",
    "TapDirection",
    "TapTest",
    "TapsEmulator",
    "TapsFaults",
    "TapsSource",
    "Trigger",
    "apply_exponential_window",
    "atomic_write",
    "average_good_hits",
    "calibrate_by_mass",
    "calibration_remark",
    "capture_hits",
    "channel_remarks",
    "check_hit",
    "check_name",
    "check_rate",
    "check_settings",
    "compute_cross_spectra",
    "convert",
    "correct_windowed_receptance",
    "estimate_decay_time",
    "estimate_frf",
    "evaluate_hit",
    "explain_no_ports",
    "extract_free_decay",
    "find_driver",
    "find_hit_time",
    "find_usb_identity",
    "find_usb_port",
    "from_accelerance",
    "infer_averages",
    "infer_recorded_share",
    "infer_window",
    "inspect_file",
    "is_smoothed",
    "list_driver_names",
    "list_formats",
    "list_frf_points",
    "list_serial_ports",
    "load_drivers",
    "measure_rate",
    "measure_skew",
    "measure_time_after_hit",
    "merge_remarks",
    "new_tap_id",
    "parse_direction",
    "parse_machine_name",
    "probe_port",
    "propagate_force_noise",
    "rate_remark",
    "read_frf",
    "read_hits",
    "read_recording",
    "read_tap",
    "read_tap_hits",
    "remove_frf_delay",
    "remove_hit_delay",
    "remove_sensor_mass",
    "sanitize_id_part",
    "scan_ports",
    "skip_serial_probe",
    "stiffness_remark",
    "unit_mistake_remark",
    "write_hit",
    "write_tap",
]
