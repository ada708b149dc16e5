"""Many machines at once: how each stands, small and quick to read, and the tap tests of all as one table."""

from .plant import Plant
from .summarise import summarise_folder, summarise_with_rows

__all__ = [
    "Plant",
    "summarise_folder",
    "summarise_with_rows",
]
