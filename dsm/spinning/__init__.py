"""Spinning beams that need not be round."""
