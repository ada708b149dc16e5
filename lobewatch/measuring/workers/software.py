"""The software that results depend on beside their data."""

from __future__ import annotations

import platform
from importlib.metadata import version
from typing import NamedTuple


class Software(NamedTuple):
    """Versions of this program and of what computes for it."""

    lobewatch: str
    numpy: str
    scipy: str
    processor: str
    """Architecture of the processor."""

    @property
    def text(self) -> str:
        """Versions for people."""
        return f"lobewatch {self.lobewatch}, numpy {self.numpy}, scipy {self.scipy} on {self.processor}"


SOFTWARE = Software(version("lobewatch"), version("numpy"), version("scipy"), platform.machine())
"""Software of this process."""
