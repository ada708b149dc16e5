"""Recorded files as tap tests of a machine: found in folders, dated, understood, shown or stored."""

from .store_recordings import ReplayOutcome, store_recordings

__all__ = ["ReplayOutcome", "store_recordings"]
