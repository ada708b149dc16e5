"""Evaluate whether a hit is good."""
