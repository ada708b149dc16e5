"""Dynamic stiffness matrix: assembly, condensation, count of modes."""

from dsm.matrix.assemble import HeldDof, assemble
from dsm.matrix.condense import condense_damped, condense_to_node, damped_blocks
from dsm.matrix.dynamic_stiffness import DynamicStiffness, check_frequencies, count_modes_below, full_matrices

__all__ = [
    "DynamicStiffness",
    "HeldDof",
    "assemble",
    "check_frequencies",
    "condense_damped",
    "condense_to_node",
    "count_modes_below",
    "damped_blocks",
    "full_matrices",
]
