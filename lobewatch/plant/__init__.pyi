"""Many machines at once: how each stands, small and quick to read, and the tap tests of all as one table."""

from .plant import Plant

__all__ = [
    "Plant",
]
