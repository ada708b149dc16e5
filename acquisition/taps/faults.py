"""What can go wrong with a TAPS/1 device and its cable."""

from __future__ import annotations

from dataclasses import dataclass

NOISE = bytes(range(7, 71)) + b"\x00" + bytes(range(200, 230))
"""Bytes that are no frame; the end of them spoils the frame that follows."""


@dataclass(frozen=True)
class Faults:
    """What goes wrong on purpose; all off."""

    unplug_after: int | None = None
    """Hang up after so many scans of a stream, in the middle of a frame."""
    stall_after: int | None = None
    """Send nothing more after so many scans."""
    restart_after: int | None = None
    """Begin another session unasked after so many scans, once."""
    drop_every: int | None = None
    """Every so many DATA frames, one is lost on the wire."""
    corrupt_every: int | None = None
    """Every so many, one byte of one is altered."""
    duplicate_every: int | None = None
    """Every so many, one comes twice."""
    cut_every: int | None = None
    """Every so many, one lacks its second half with the delimiter, which spoils the next frame too."""
    noise_every: int | None = None
    """Every so many, noise stands before one and spoils it."""
    noise_at_start: bool = False
    """Noise stands before the first answer."""
    start_streaming: bool = False
    """The device streams already when the host connects."""
    cut_infos: int = 0
    """Number of INFO answers that lack their second half."""
    overload: int = 0
    """Mask of the channels that every DATA frame reports as overloaded."""

    def on_wire(self, encoded: bytes, count: int) -> bytes:
        """What arrives of the count-th DATA frame."""
        if _is_due(self.drop_every, count):
            return b""
        if _is_due(self.corrupt_every, count):
            encoded = encoded[:40] + bytes([encoded[40] ^ 0x55 or 1]) + encoded[41:]
        if _is_due(self.cut_every, count):
            encoded = encoded[: len(encoded) // 2]
        if _is_due(self.duplicate_every, count):
            encoded *= 2
        return NOISE + encoded if _is_due(self.noise_every, count) else encoded


def _is_due(period: int | None, count: int) -> bool:
    return period is not None and count % period == 0
