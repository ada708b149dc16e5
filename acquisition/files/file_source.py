"""Source that replays recorded hits like a live device."""

import threading
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from acquisition.arrays import Codes
from acquisition.channel import Block, Channel, ChannelQuantity
from acquisition.files.read_recording import read_hits
from acquisition.hit import Hit
from acquisition.hits.pulse import count_pre_hit_samples
from acquisition.source import RECORDING_MODEL_PREFIX, ClosedOnExit, DeviceIdentity, Event

REPLAY_QUIET_TIME = 1.0
"""Time without a hit before, between and after the hits (s)."""
REPLAY_BLOCK_SCANS = 512
"""Number of scans per block."""
REPLAY_ADC_BITS = 24
"""Resolution of the virtual converter for recordings without codes (bits)."""


class FileSource(ClosedOnExit):
    """Source of the hits of a recording, with quiet between them.

    Codes are those of the recording, bit by bit, and so are lost scans and reported overloads. A recording without
    codes (LVM, text) passes a virtual converter of 24 bits whose rail is the largest value in the file: its steps are
    1e-7 of that, and a value at a rail for long is an overload, as it was before. The quiet is the recording's own
    noise before a pulse, repeated.
    """

    follows_clock = False
    """False, as scans come at no measurable rate."""
    loss_detection = ""
    """Method of detecting lost scans; empty as none can be lost."""
    fault = ""
    """Present fault; there is never one."""

    def __init__(self, path: Path | str, realtime: bool = True) -> None:
        """Read the hits of a file.

        Parameters
        ----------
        path
            File that `read_hits` can read.
        realtime
            Whether blocks come at their sample rate instead of at once.

        Raises
        ------
        DataError
            If the file has no hits.
        """
        hits = read_hits(path)
        quantities: tuple[ChannelQuantity, ...] = ("force", "acceleration") if hits[0].has_force else ("acceleration",)
        self.channels = hits[0].channels or tuple(_make_channel(quantity, hits) for quantity in quantities)
        """Channels of the recording."""
        self.sample_rate = hits[0].sample_rate
        """Scans a second (Hz)."""
        self.identity = DeviceIdentity(f"{RECORDING_MODEL_PREFIX}{Path(path).name}")
        """Name of the file."""
        self.events: deque[Event] = deque()
        """Empty: a file has no events."""
        self._hits, self._realtime = hits, realtime
        self._stopped = threading.Event()

    def start(self) -> None:
        """Start at the first hit."""
        self._stopped.clear()

    def stop(self) -> None:
        """Stop at the next block."""
        self._stopped.set()

    def close(self) -> None:
        """Stop at the next block; the file is already closed."""
        self.stop()

    def blocks(self) -> Iterator[Block]:
        """Yield the blocks, which end some quiet after the last hit."""
        began, scan = time.monotonic(), 0
        for block in self._pieces():
            scan += block.lost_before
            due = began + (scan + block.codes.shape[1]) / self.sample_rate
            if self._stopped.wait(max(due - time.monotonic(), 0.0) if self._realtime else 0.0):
                return
            yield Block(scan, block.codes, block.overload, block.lost_before)
            scan += block.codes.shape[1]

    def _pieces(self) -> Iterator[Block]:
        """Yield blocks without their index."""
        pause = round(REPLAY_QUIET_TIME * self.sample_rate)
        for hit in self._hits:
            codes = hit.codes
            if codes is None:
                coded = zip(self.channels, hit.signals, strict=True)
                codes = np.stack([channel.encode(values) for channel, values in coded])
            quiet = _extract_quiet_scans(hit, codes)
            yield from _split_blocks(np.resize(quiet, (pause, len(self.channels))).T)
            middle = codes.shape[1] // 2
            yield from _split_blocks(codes[:, :middle], hit.overload)
            yield from _split_blocks(codes[:, middle:], hit.overload, hit.lost_scans)
        yield from _split_blocks(np.resize(quiet, (pause, len(self.channels))).T)


def _make_channel(quantity: ChannelQuantity, hits: list[Hit]) -> Channel:
    """Make a channel of 1 V per unit whose rail is the largest value, with its sign."""
    values = np.concatenate([getattr(hit, quantity) for hit in hits])
    largest = float(values[np.argmax(np.abs(values))])
    top = 2 ** (REPLAY_ADC_BITS - 1)
    full_scale = largest * top / (top - 1) if largest > 0 else -largest
    return Channel(quantity, 1.0, full_scale or 1.0, REPLAY_ADC_BITS)


def _extract_quiet_scans(hit: Hit, codes: Codes) -> Codes:
    """Return four fifths of the scans before the pulse, without its foot, forwards and backwards, (n, channels)."""
    before = int(0.8 * count_pre_hit_samples(hit))
    noise = codes.T[: max(before, 1)]
    return np.concatenate([noise, noise[::-1]])


def _split_blocks(codes: Codes, overload: int = 0, lost_before: int = 0) -> Iterator[Block]:
    for first in range(0, codes.shape[1], REPLAY_BLOCK_SCANS):
        block = codes[:, first : first + REPLAY_BLOCK_SCANS]
        yield Block(0, block, overload, lost_before if first == 0 else 0)
