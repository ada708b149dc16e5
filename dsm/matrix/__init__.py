"""The dynamic stiffness matrix: assembly, condensation, count of modes."""

from dsm.matrix.assemble import Held, assemble
from dsm.matrix.condense import condense
from dsm.matrix.condense_damped import condense_damped
from dsm.matrix.count_below import count_below
from dsm.matrix.damped_blocks import damped_blocks
from dsm.matrix.dynamic_stiffness import DynamicStiffness, full_matrices
from dsm.matrix.frequency_axis import frequency_axis

__all__ = [
    "DynamicStiffness",
    "Held",
    "assemble",
    "condense",
    "condense_damped",
    "count_below",
    "damped_blocks",
    "frequency_axis",
    "full_matrices",
]
