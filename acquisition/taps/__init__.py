"""TAPS/1, the open frame format for data acquisition boards: protocol, source, emulator and bridge."""

from acquisition.taps.bridge import TapsBridge
from acquisition.taps.emulator import TapsEmulator, TapsFaults
from acquisition.taps.source import TapsSource, probe_taps

__all__ = ["TapsBridge", "TapsEmulator", "TapsFaults", "TapsSource", "probe_taps"]
