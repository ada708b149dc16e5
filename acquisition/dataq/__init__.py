"""DATAQ devices (DI-1120, 2108, 2108-P, 4108, 4208, 4718B): protocol, dialogue, stream, source and emulator."""

from acquisition.dataq.dialogue import DataqDialogue
from acquisition.dataq.emulator import DataqEmulator, DataqFaults, DataqTraits
from acquisition.dataq.probe import probe_dataq
from acquisition.dataq.protocol import check_inputs
from acquisition.dataq.source import DataqSource

__all__ = [
    "DataqDialogue",
    "DataqEmulator",
    "DataqFaults",
    "DataqSource",
    "DataqTraits",
    "check_inputs",
    "probe_dataq",
]
