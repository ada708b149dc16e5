"""What is known of one machine: machine.toml, its folder, its journal, its devices."""

from .archive.tap_entry import DamagedTapError, TapEntry
from .cut_tables import CutTable, ProgramTable
from .daq_tables import Daq
from .doubt_table import DoubtTable
from .drive import drive_limit
from .folder import BusyError, MachineFolder
from .known_devices import checked_rate, has_clock, known_rate, use_rate
from .machine_file import REFERENCE_CUT, Machine
from .new_folder import make_machine_folder
from .setup_tables import Limits, SpeedRange, TapSetup

__all__ = [
    "REFERENCE_CUT",
    "BusyError",
    "CutTable",
    "DamagedTapError",
    "Daq",
    "DoubtTable",
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
    "make_machine_folder",
    "use_rate",
]
