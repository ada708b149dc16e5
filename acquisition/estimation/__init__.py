"""Estimation and correction of averaged FRFs from hits."""
