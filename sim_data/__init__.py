"""Data of the simulated example: its machine file, two tap tests and two cuts, and the script that made them."""
