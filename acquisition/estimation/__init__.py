"""Estimation of averaged FRFs from hits, and correction of the FRFs."""
