"""Tap tests as HDF5 files, and recordings of other programs."""
