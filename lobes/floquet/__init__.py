"""Semi-discretisation of high order: the map of milling over one tooth period, and its largest multiplier."""

from lobes.floquet.growth import growth
from lobes.floquet.milling_rows import MillingRows, joined_rows, rows_of
from lobes.floquet.multipliers import largest_multipliers
from lobes.floquet.pieces import piece_numbers

__all__ = ["MillingRows", "growth", "joined_rows", "largest_multipliers", "piece_numbers", "rows_of"]
