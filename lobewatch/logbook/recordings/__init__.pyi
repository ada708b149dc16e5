"""Recorded files as tap tests of a machine: find, read, prepare and store them."""

from .store_recordings import ReplayOutcome, store_recordings

__all__ = ["ReplayOutcome", "store_recordings"]
