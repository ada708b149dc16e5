"""Show the comparison with the paper."""
