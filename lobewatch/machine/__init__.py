"""What is known of one machine: machine.toml, its folder, its journal, its devices."""

from lobewatch.machine.cut_tables import CutTable, ProgramTable
from lobewatch.machine.daq_tables import Daq
from lobewatch.machine.drive import drive_limit
from lobewatch.machine.folder import BusyError, MachineFolder, TapEntry
from lobewatch.machine.known_devices import Device, checked_rate, has_clock, known_rate, use_rate
from lobewatch.machine.machine_file import REFERENCE_CUT, Limits, Machine, SpeedRange, TapSetup

__all__ = [
    "REFERENCE_CUT",
    "BusyError",
    "CutTable",
    "Daq",
    "Device",
    "Limits",
    "Machine",
    "MachineFolder",
    "ProgramTable",
    "SpeedRange",
    "TapEntry",
    "TapSetup",
    "checked_rate",
    "drive_limit",
    "has_clock",
    "known_rate",
    "use_rate",
]
