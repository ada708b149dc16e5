"""Journal of a machine and its entries."""
