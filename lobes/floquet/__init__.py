"""Semi-discretisation of high order: milling over one tooth period, its largest multiplier, and the limits from it."""

from lobes.floquet.growth import growth
from lobes.floquet.milling_rows import MillingRows, joined_rows, rows_of
from lobes.floquet.multipliers import largest_multipliers
from lobes.floquet.pieces import piece_numbers
from lobes.floquet.program_limit import ProgramLimit, program_limit
from lobes.floquet.spectral_radius import spectral_radius
from lobes.floquet.stability_boundary import stability_boundary

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
