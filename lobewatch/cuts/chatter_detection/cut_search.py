"""Search for the newest cut in a stream, at little cost, by the bands of its pieces."""

from collections import deque

import numpy as np

from lobewatch.arrays import Floats
from lobewatch.cuts.chatter_detection import cut_detection as cuts

N_SEARCH_BANDS = 64
"""Number of bands into which the power of a piece is averaged; chosen."""


class CutSearch:
    """Search in the pieces of a stream, each transformed once."""

    def __init__(self, sample_rate: float, turn: float, kept: float) -> None:
        """Search in a stream with a sample rate (Hz); turn: of the spindle (s); kept: length that is searched (s)."""
        self._rate, self._size = sample_rate, round(max(cuts.CUT_PIECE_LENGTH, 2 * turn) * sample_rate)
        self._step = self._size // 2
        self._pieces = deque[Floats](maxlen=round(kept * sample_rate / self._step))
        self._waiting = list[Floats]()
        self._first = 0

    def add(self, signal: Floats) -> None:
        """Add what follows of the stream, shape (axes, n)."""
        self._waiting.append(signal)

    def find_newest(self) -> tuple[float, float] | None:
        """Return begin and end of the newest cut from the beginning of the stream (s), or None."""
        self._transform()
        if len(self._pieces) < 2 * cuts.N_QUIET_PIECES:
            return None
        is_loud = cuts.find_loud_pieces(list(np.stack(self._pieces, axis=1)))
        gap = cuts.MAX_PAUSE_TIME * self._rate / self._step
        stretches = cuts.join_stretches(cuts.find_stretches(is_loud), gap)
        least = cuts.MAX_KNOCK_TIME * self._rate / self._step
        found = [(first, last) for first, last in stretches if last - first > least]
        if not found:
            return None
        begin, end = ((self._first + place) * self._step / self._rate for place in (found[-1][0] + 1, found[-1][1]))
        return begin, end

    def forget(self, before: float) -> None:
        """Forget the stream before a time from its beginning (s)."""
        while self._pieces and self._first * self._step < before * self._rate:
            self._pieces.popleft()
            self._first += 1

    def _transform(self) -> None:
        """Transform the pieces that are complete, and keep the rest."""
        if not self._waiting:
            return
        signal = np.concatenate(self._waiting, axis=1)
        count = (signal.shape[1] - self._size) // self._step + 1
        if count > 0:
            windows = np.lib.stride_tricks.sliding_window_view(signal, self._size, axis=1)[:, :: self._step][:, :count]
            power = np.stack([cuts.compute_piece_power(axis, self._rate) for axis in windows])
            edges = np.linspace(0, power.shape[2], N_SEARCH_BANDS + 1).astype(int)[:-1]
            bands = np.add.reduceat(power, np.unique(edges), axis=2)
            full = (self._pieces.maxlen or 0) - len(self._pieces)
            self._first += max(count - full, 0)
            self._pieces.extend(np.moveaxis(bands, 1, 0))
            signal = signal[:, count * self._step :]
        self._waiting = [signal]
