"""DATAQ devices (DI-1120, 2108, 2108-P, 4108, 4208, 4718B): protocol, stream decoder, source and emulator."""

from acquisition.dataq.emulator import DataqEmulator, DataqFaults, DataqTraits
from acquisition.dataq.protocol import DataqCommandLink, check_inputs, probe_dataq
from acquisition.dataq.source import DataqSource

__all__ = [
    "DataqCommandLink",
    "DataqEmulator",
    "DataqFaults",
    "DataqSource",
    "DataqTraits",
    "check_inputs",
    "probe_dataq",
]
