"""What programs use of lobewatch."""

from .logbook import Logbook

__all__ = ["Logbook"]
