"""History of a machine: a row for each tap test, its cache on the disk, and its export."""

from .history import History, HistoryRow

__all__ = ["History", "HistoryRow"]
