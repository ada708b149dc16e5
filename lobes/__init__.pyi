"""From modes or FRFs to stability lobes, advice for cutting programs, and the history of the lobes of one machine."""

from .aged_mode import aged_mode
from .average_angle import average_angle
from .coefficients import Coefficients, tangential_and_radial
from .cut import Cut, Direction
from .cutting_power import deepest_for_drive, mean_torque
from .floquet import (
    MillingRows,
    ProgramLimit,
    growth,
    joined_rows,
    piece_numbers,
    program_limit,
    rows_of,
    spectral_radius,
    stability_boundary,
)
from .history import SldHistory
from .history_file import read_history, write_history
from .known_materials import (
    cutting_coefficients,
    find_materials,
    folded_name,
    materials_by_name,
    nearest_name,
)
from .lowest_of import lowest_of
from .milling_system import milling_system
from .pitch_patterns import PitchPattern, equal_pitch, half_wave_deg, pitch_patterns, with_pattern
from .pockets import Pocket, PocketShift, best_pockets, pocket_shifts, pockets
from .program import Program
from .radial_lobes import RadialLobes, radial_lobes
from .shown_modes import ShownModes, shown_modes
from .specific_force import SpecificForce
from .stability_lobes import Lobe, MethodName, Minimum, StabilityLobes
from .tool_data import (
    TOOL_MATERIALS,
    CutKind,
    PublishedRange,
    ToolMaterial,
    cut_kind,
    cutting_speed,
    fastest_of_all,
    feed_per_tooth,
)
from .zero_order import zero_order

__all__ = [
    "TOOL_MATERIALS",
    "Coefficients",
    "Cut",
    "CutKind",
    "Direction",
    "Lobe",
    "MethodName",
    "MillingRows",
    "Minimum",
    "PitchPattern",
    "Pocket",
    "PocketShift",
    "Program",
    "ProgramLimit",
    "PublishedRange",
    "RadialLobes",
    "ShownModes",
    "SldHistory",
    "SpecificForce",
    "StabilityLobes",
    "ToolMaterial",
    "aged_mode",
    "average_angle",
    "best_pockets",
    "cut_kind",
    "cutting_coefficients",
    "cutting_speed",
    "deepest_for_drive",
    "equal_pitch",
    "fastest_of_all",
    "feed_per_tooth",
    "find_materials",
    "folded_name",
    "growth",
    "half_wave_deg",
    "joined_rows",
    "lowest_of",
    "materials_by_name",
    "mean_torque",
    "milling_system",
    "nearest_name",
    "piece_numbers",
    "pitch_patterns",
    "pocket_shifts",
    "pockets",
    "program_limit",
    "radial_lobes",
    "read_history",
    "rows_of",
    "shown_modes",
    "spectral_radius",
    "stability_boundary",
    "tangential_and_radial",
    "with_pattern",
    "write_history",
    "zero_order",
]
