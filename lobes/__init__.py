"""From modes or FRFs to stability lobes, advice for cutting programs, and the history of the lobes of one machine."""

from lobes.aged_mode import aged_mode
from lobes.average_angle import average_angle
from lobes.coefficients import Coefficients, tangential_and_radial
from lobes.cut import Cut, Direction
from lobes.cutting_power import deepest_for_drive, mean_torque
from lobes.floquet import (
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
from lobes.history import SldHistory
from lobes.history_file import read_history, write_history
from lobes.known_materials import (
    cutting_coefficients,
    find_materials,
    folded_name,
    materials_by_name,
    nearest_name,
)
from lobes.lowest_of import lowest_of
from lobes.milling_system import milling_system
from lobes.pitch_patterns import PitchPattern, equal_pitch, half_wave_deg, pitch_patterns, with_pattern
from lobes.pockets import Pocket, PocketShift, best_pockets, pocket_shifts, pockets
from lobes.program import Program
from lobes.radial_lobes import RadialLobes, radial_lobes
from lobes.shown_modes import ShownModes, shown_modes
from lobes.specific_force import SpecificForce
from lobes.stability_lobes import Lobe, MethodName, Minimum, StabilityLobes
from lobes.tool_data import (
    TOOL_MATERIALS,
    CutKind,
    PublishedRange,
    ToolMaterial,
    cut_kind,
    cutting_speed,
    fastest_of_all,
    feed_per_tooth,
)
from lobes.zero_order import zero_order

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
