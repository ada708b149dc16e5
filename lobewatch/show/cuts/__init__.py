"""Presentation of recorded and suggested test cuts."""
