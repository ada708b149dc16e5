"""What results depend on beside their data."""

from __future__ import annotations

import platform
from importlib.metadata import version
from typing import NamedTuple


class Software(NamedTuple):
    """Versions."""

    lobewatch: str
    numpy: str
    scipy: str
    processor: str
    """Its architecture."""

    @property
    def text(self) -> str:
        """For people."""
        return f"lobewatch {self.lobewatch}, numpy {self.numpy}, scipy {self.scipy} on {self.processor}"


SOFTWARE = Software(version("lobewatch"), version("numpy"), version("scipy"), platform.machine())
"""Of this process."""
