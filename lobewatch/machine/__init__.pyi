"""What is known of one machine: machine.toml, its folder, its journal, its devices."""

from .archive.verify import verify
from .folder import MachineFolder
from .folder_lock import BusyError
from .journal.tap_entry import BY_FIT, DamagedTapError, TapEntry
from .known_devices import checked_rate, has_clock, known_rate, use_rate
from .new_folder import make_machine_folder
from .settings.cut_tables import FEED_ANGLES, CutTable, ProgramTable, Wear
from .settings.daq_tables import Daq
from .settings.doubt_table import DoubtTable
from .settings.drive import drive_limit
from .settings.known_tool import KnownTool, known_tool
from .settings.machine_file import REFERENCE_CUT, Machine
from .settings.setup_tables import Limits, SpeedRange, TapSetup
from .settings.tool_limits import ToolLimits, Unknown, tool_limits

__all__ = [
    "BY_FIT",
    "FEED_ANGLES",
    "REFERENCE_CUT",
    "BusyError",
    "CutTable",
    "DamagedTapError",
    "Daq",
    "DoubtTable",
    "KnownTool",
    "Limits",
    "Machine",
    "MachineFolder",
    "ProgramTable",
    "SpeedRange",
    "TapEntry",
    "TapSetup",
    "ToolLimits",
    "Unknown",
    "Wear",
    "checked_rate",
    "drive_limit",
    "has_clock",
    "known_rate",
    "known_tool",
    "make_machine_folder",
    "tool_limits",
    "use_rate",
    "verify",
]
