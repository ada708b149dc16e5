"""What programs use of lobewatch."""

from .analysis import Logbook

__all__ = ["Logbook"]
