"""Presentation of the comparison with the paper."""
