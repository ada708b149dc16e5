"""Milling stability: lobes, stable pockets, published cutting data and SLD history."""

from .coefficients import CuttingCoefficients, SpecificForce, tangential_and_radial
from .cut import Cut, Direction, Program, max_depth_for_drive, mean_torque
from .floquet import (
    MillingRows,
    ProgramLimit,
    count_pieces,
    growth_rate,
    join_rows,
    program_limit,
    rows_at_speeds,
    spectral_radius,
    stability_boundary,
)
from .history import SldHistory
from .history_file import read_history, write_history
from .materials import (
    all_cutting_coefficients,
    explain_unknown_material,
    find_materials,
    fold_material_name,
    materials_by_name,
)
from .milling_system import ProjectedModes, age_mode, build_milling_system, project_modes
from .pitch_patterns import PitchPattern, equal_pitch, half_wave_deg, pitch_patterns, with_pitch_pattern
from .pockets import Pocket, PocketShift, find_pockets, match_pockets, rank_pockets
from .stability_lobes import Lobe, LobeMinimum, MethodName, RadialLobes, StabilityLobes, lower_envelope, radial_lobes
from .tool_data import (
    TOOL_MATERIALS,
    CutKind,
    PublishedRange,
    ToolMaterial,
    classify_cut,
    published_cutting_speed,
    published_feed_per_tooth,
    published_speed_of_any_tool,
)
from .zero_order import average_angle_lobes, zero_order_lobes

__all__ = [
    "TOOL_MATERIALS",
    "Cut",
    "CutKind",
    "CuttingCoefficients",
    "Direction",
    "Lobe",
    "LobeMinimum",
    "MethodName",
    "MillingRows",
    "PitchPattern",
    "Pocket",
    "PocketShift",
    "Program",
    "ProgramLimit",
    "ProjectedModes",
    "PublishedRange",
    "RadialLobes",
    "SldHistory",
    "SpecificForce",
    "StabilityLobes",
    "ToolMaterial",
    "age_mode",
    "all_cutting_coefficients",
    "average_angle_lobes",
    "build_milling_system",
    "classify_cut",
    "count_pieces",
    "equal_pitch",
    "explain_unknown_material",
    "find_materials",
    "find_pockets",
    "fold_material_name",
    "growth_rate",
    "half_wave_deg",
    "join_rows",
    "lower_envelope",
    "match_pockets",
    "materials_by_name",
    "max_depth_for_drive",
    "mean_torque",
    "pitch_patterns",
    "program_limit",
    "project_modes",
    "published_cutting_speed",
    "published_feed_per_tooth",
    "published_speed_of_any_tool",
    "radial_lobes",
    "rank_pockets",
    "read_history",
    "rows_at_speeds",
    "spectral_radius",
    "stability_boundary",
    "tangential_and_radial",
    "with_pitch_pattern",
    "write_history",
    "zero_order_lobes",
]
