"""Semi-discretisation of high order: milling over one tooth period, its largest multiplier, and the limits from it."""

from .growth import growth
from .milling_rows import MillingRows, joined_rows, rows_of
from .multipliers import largest_multipliers
from .pieces import piece_numbers
from .program_limit import ProgramLimit, program_limit
from .spectral_radius import spectral_radius
from .stability_boundary import stability_boundary

__all__ = [
    "MillingRows",
    "ProgramLimit",
    "growth",
    "joined_rows",
    "largest_multipliers",
    "piece_numbers",
    "program_limit",
    "rows_of",
    "spectral_radius",
    "stability_boundary",
]
