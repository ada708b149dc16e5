"""Data of one machine: machine.toml, its folder, its journal and its DAQ."""

from .daq_rates import apply_measured_rate, check_device_rate, find_stored_rate, has_clock
from .folder import MachineFolder
from .folder_files import make_machine_folder
from .folder_lock import BusyError
from .journal.tap_entry import NO_MODE_EDITS, DamagedTapError, TapEntry
from .settings.cut_tables import FEED_ANGLES, CutTable, ProgramTable, ToolWear, UncertaintyTable
from .settings.drive_power import drive_depth_limit
from .settings.machine_file import REFERENCE_CUT, Machine
from .settings.setup_tables import DaqTable, LimitsTable, SpeedTable, TapTable
from .settings.tool_limits import MissingToolData, ToolLimits, ToolProperties, find_tool_limits, find_tool_properties
from .verify_files import verify

__all__ = [
    "FEED_ANGLES",
    "NO_MODE_EDITS",
    "REFERENCE_CUT",
    "BusyError",
    "CutTable",
    "DamagedTapError",
    "DaqTable",
    "LimitsTable",
    "Machine",
    "MachineFolder",
    "MissingToolData",
    "ProgramTable",
    "SpeedTable",
    "TapEntry",
    "TapTable",
    "ToolLimits",
    "ToolProperties",
    "ToolWear",
    "UncertaintyTable",
    "apply_measured_rate",
    "check_device_rate",
    "drive_depth_limit",
    "find_stored_rate",
    "find_tool_limits",
    "find_tool_properties",
    "has_clock",
    "make_machine_folder",
    "verify",
]
