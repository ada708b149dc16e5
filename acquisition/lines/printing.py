"""What a board prints."""

from __future__ import annotations

from dataclasses import dataclass

from acquisition.lines.frames import FrameFormat

BAUD_RATE = 115200
"""Of a port that is no USB device itself (baud), where none is asked for."""


@dataclass(frozen=True)
class Printing:
    """Numbers, what holds them, and how fast they come."""

    adc_bits: int | None = None
    """Bits of the converter whose codes, from 0 on, stand in the lines; None where volts do."""
    frame: FrameFormat | None = None
    """Frames; None where it prints lines."""
    baud_rate: int = BAUD_RATE
    """Of a serial port that is no USB device itself (baud)."""

    @property
    def bits(self) -> int:
        """Bits of the codes that are made of the numbers: 24 of volts, so that nothing is lost."""
        return self.adc_bits or (16 if self.frame else 24)
