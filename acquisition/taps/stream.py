"""The scans of one TAPS/1 stream: each at most once, what is missing counted, what does not belong to it refused."""

from __future__ import annotations

from acquisition.channel import Block
from acquisition.taps.protocol import LOST_BEFORE, Frame, decode_data


class ScanStream:
    """Blocks from the DATA frames of one session, in order."""

    def __init__(self, session: int, n_channels: int) -> None:
        """The session that the ACK of START names, and the number of channels asked for in CONFIG."""
        self._session, self._n_channels = session, n_channels
        self._next_scan = 0
        self.lost_scans = 0
        """Scans that never came."""
        self.refused = 0
        """DATA frames of this session that came twice or late, or contradict their own header."""
        self.foreign = 0
        """DATA frames of other sessions since the last one of this."""

    def accept(self, frame: Frame) -> Block | None:
        """The block of a DATA frame with the scans lost before it; None where it is refused.

        An index that jumps tells how many scans are missing. Where the device says that it lost some and the index
        does not jump, one is counted, so that no hit with that joint in it passes.
        """
        if frame.session != self._session:
            self.foreign += 1
            return None
        try:
            block = decode_data(frame.body)
        except ValueError:
            self.refused += 1
            return None
        if block.codes.shape[0] != self._n_channels or block.first_scan < self._next_scan:
            self.refused += 1
            return None
        lost = block.first_scan - self._next_scan or int(bool(frame.flags & LOST_BEFORE))
        self._next_scan = block.first_scan + block.codes.shape[1]
        self.lost_scans += lost
        self.foreign = 0
        return Block(block.first_scan, block.codes, block.overload, lost)
