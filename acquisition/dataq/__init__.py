"""Drivers of DATAQ devices: protocol, stream decoder, source and emulator."""

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
