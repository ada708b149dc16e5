"""TAPS/1, the open frame for data acquisition boards: protocol, events, stream, source, emulator and bridge."""

from acquisition.taps.bridge import TapsBridge
from acquisition.taps.emulator import TapsEmulator
from acquisition.taps.faults import Faults
from acquisition.taps.probe import probe_taps
from acquisition.taps.protocol import Frame, FrameDecoder, MessageType, encode_frame
from acquisition.taps.source import TapsSource

__all__ = [
    "Faults",
    "Frame",
    "FrameDecoder",
    "MessageType",
    "TapsBridge",
    "TapsEmulator",
    "TapsSource",
    "encode_frame",
    "probe_taps",
]
