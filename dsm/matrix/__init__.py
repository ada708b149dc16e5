"""Dynamic stiffness matrix: assembly, condensation, count of modes."""
