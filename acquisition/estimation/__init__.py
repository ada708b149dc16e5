"""Estimate averaged FRFs from hits and correct them."""
