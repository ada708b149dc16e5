"""Spindle as plain data: segments, materials, bearings, masses, joints."""
