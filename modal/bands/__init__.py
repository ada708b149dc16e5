"""Modes band by band: found as peaks, fitted, settled with each other's tails, and looked at closer."""
