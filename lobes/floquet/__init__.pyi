"""High-order semi-discretization of milling: Floquet multipliers and stability limits."""

from .milling_rows import MillingRows, count_pieces, join_rows, rows_at_speeds
from .multipliers import growth_rate, largest_multipliers
from .program_limit import ProgramLimit, program_limit
from .stability_boundary import spectral_radius, stability_boundary

__all__ = [
    "MillingRows",
    "ProgramLimit",
    "count_pieces",
    "growth_rate",
    "join_rows",
    "largest_multipliers",
    "program_limit",
    "rows_at_speeds",
    "spectral_radius",
    "stability_boundary",
]
