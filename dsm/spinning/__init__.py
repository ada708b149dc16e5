"""Spinning beams of any cross-section."""
