"""Estimation of averaged FRFs from hits, and their correction."""
