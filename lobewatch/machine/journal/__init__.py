"""Journal of a machine and its lines."""
