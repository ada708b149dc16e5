"""The history of a machine: a row for each tap test, its place on the disk, what still holds, damage met once."""

from .history import History, HistoryRow

__all__ = ["History", "HistoryRow"]
