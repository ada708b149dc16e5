"""Fleet of machines: status and summary of each, and the tap tests of all as one table."""

from .fleet import Fleet
from .summarize import summarize_folder, summarize_with_rows

__all__ = ["Fleet", "summarize_folder", "summarize_with_rows"]
