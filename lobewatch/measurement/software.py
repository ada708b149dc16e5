"""Versions of the software that results depend on."""

import platform
from importlib.metadata import version
from typing import NamedTuple

ANALYSIS_REVISION = 5
"""Number that rises when results of the same tap tests change within a version: stored rows are computed again."""


class SoftwareVersions(NamedTuple):
    """Versions of this program and of its numerical libraries."""

    lobewatch: str
    numpy: str
    scipy: str
    processor: str
    """Architecture of the processor."""

    @property
    def text(self) -> str:
        """Versions in words."""
        return f"lobewatch {self.lobewatch}, numpy {self.numpy}, scipy {self.scipy} on {self.processor}"


CURRENT_SOFTWARE = SoftwareVersions(version("lobewatch"), version("numpy"), version("scipy"), platform.machine())
"""Software of this process."""
