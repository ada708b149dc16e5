"""Data of the simulated example: the surrogate spindle as a machine file."""
