"""The DATAQ DI-x108 devices: protocol, dialogue, stream, source and emulator."""

from acquisition.dataq.dialogue import DataqDialogue
from acquisition.dataq.emulator import DataqEmulator, DataqFaults, DataqTraits
from acquisition.dataq.protocol import VENDOR, DataqInput
from acquisition.dataq.source import DataqSource

__all__ = [
    "VENDOR",
    "DataqDialogue",
    "DataqEmulator",
    "DataqFaults",
    "DataqInput",
    "DataqSource",
    "DataqTraits",
]
