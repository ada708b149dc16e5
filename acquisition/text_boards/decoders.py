"""Decode the text lines or binary frames that a board prints, and count lost scans.

The payload of a frame is a scan: the counter (u16), if there is one, and a value (i16) per sensor, little-endian. The
checksum is the lowest byte of the sum of the payload's bytes (SerialPlot, "custom frame format").
"""

from collections.abc import Container, Iterable, Iterator, Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acquisition.arrays import Floats

COUNTER_MODULI = (1 << 8, 1 << 16, 1 << 32)
"""Values at which board counters wrap to 0."""


class PrintedRows(NamedTuple):
    """Consecutive rows of numbers without a broken one between them."""

    rows: Floats
    """Numbers, shape (n_scans, n_columns)."""
    broken_before: int = 0
    """Number of broken lines or frames before them."""


class ScanCounter:
    """Counter of lost scans, which removes the printed counter from the rows."""

    def __init__(self, values: int = 2) -> None:
        """Expect this number of values per row besides the counter."""
        self._values = values
        self._last: int | None = None
        self._largest = 0

    def split_runs(self, printed: PrintedRows) -> Iterator[tuple[Floats, int]]:
        """Yield runs of consecutive scans from rows of values, with or without a counter.

        Each is its values as printed, shape (n_sensors, n_scans), and the number of scans lost before it, by the
        counter. Without one, that is the number of broken lines or frames: a lower bound.
        """
        values = printed.rows[:, -self._values :].T
        if printed.rows.shape[1] == self._values:
            yield values, printed.broken_before
            return
        counts = printed.rows[:, 0].astype(np.int64)
        lost = self._lost(counts)
        for run in np.split(np.arange(counts.size), np.flatnonzero(lost[1:]) + 1):
            yield values[:, run], int(lost[run[0]])

    def _lost(self, counts: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the scans lost before each row. The counter wraps at the smallest modulus above all counts so far."""
        self._largest = max(self._largest, int(counts.max()))
        modulus = next((modulus for modulus in COUNTER_MODULI if modulus > self._largest), COUNTER_MODULI[-1])
        before = counts[0] - 1 if self._last is None else self._last
        self._last = int(counts[-1])
        return (np.diff(counts, prepend=before) - 1) % modulus


NUMBER_SEPARATORS = bytes.maketrans(b";\t ", b",,,")
"""Separators between numbers besides a comma."""
MAX_LINE_BYTES = 200
"""Longest line of numbers (bytes)."""
EMULATED_LINE = b"# emulated device"
"""Line among the numbers by which an emulated board says that it is emulated."""
UNCLOCKED_LINE = b"# emulated device without a clock"
"""Line of an emulated board that prints as fast as the host reads."""


class _RowDecoder:
    """Decoder of a stream into rows of numbers, which counts the broken ones."""

    def __init__(self) -> None:
        self._rest, self._begun, self._broken = b"", False, 0

    def _split_at_broken(self, rows: Iterable[Sequence[float]]) -> Iterator[PrintedRows]:
        """Yield the runs of rows between broken ones, which are empty."""
        for is_good, run in groupby(rows, bool):
            values = np.array([*run], np.float64)
            if is_good:
                yield PrintedRows(values, self._broken)
            self._broken = 0 if is_good else self._broken + len(values)


class LineDecoder(_RowDecoder):
    """Decoder of a text stream into rows of numbers."""

    def __init__(self, counts: Container[int] = (2, 3)) -> None:
        """Accept lines with these counts of numbers. The rest of the first line is not counted."""
        super().__init__()
        self._columns, self._counts = 0, counts
        self.is_emulated = False
        """True after the board has said that it is emulated."""
        self.follows_clock = True
        """False after the board has said that it prints as fast as the host reads."""

    def feed(self, data: bytes) -> Iterator[PrintedRows]:
        """Yield the rows that these bytes complete."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        self._rest = self._rest[: MAX_LINE_BYTES + 1]  # what is too long stays too long until its end comes
        if lines and not self._begun:
            self._begun, lines = True, lines[1:]
        texts = [line.strip() for line in lines]
        self.follows_clock &= UNCLOCKED_LINE not in texts
        self.is_emulated |= EMULATED_LINE in texts or not self.follows_clock
        silent = (b"", EMULATED_LINE, UNCLOCKED_LINE)
        yield from self._split_at_broken(self._parse_line(text) for text in texts if text not in silent)

    def _parse_line(self, line: bytes) -> list[float]:
        """Return the numbers of a line, as many as in the first, none if it contains anything else.

        No counter, code or voltage reaches the largest modulus of a counter.
        """
        words = line[: MAX_LINE_BYTES + 1].translate(NUMBER_SEPARATORS).split(b",")
        try:
            row = [float(word) for word in words if word]
        except ValueError:
            return []
        is_short = len(line) <= MAX_LINE_BYTES and len(row) in self._counts
        if not is_short or not all(abs(number) < COUNTER_MODULI[-1] for number in row):
            return []  # also NaN and infinity
        self._columns = self._columns or len(row)
        return row if len(row) == self._columns else []


class FrameFormat(NamedTuple):
    """Layout of a binary frame."""

    start: bytes
    """Bytes at the start of a frame."""
    counter: bool = False
    """True if a counter (u16) precedes the values."""
    checksum: bool = True
    """True if a checksum follows the values."""


MAX_UNFRAMED_BYTES = 1 << 16
"""Bytes kept without a frame in them, chosen: 5 s at 115 200 baud. Earlier bytes are a broken frame."""
MIN_FRAMES_IN_STEP = 16
"""Consecutive frames that show where frames without checksum begin."""


class SimpleFrameDecoder(_RowDecoder):
    """Decoder of a stream of frames into rows of numbers.

    A value may have the bytes of a start. Without checksum, a frame therefore counts if another start follows it, from
    the only place on where starts follow each other at the length of a frame.
    """

    def __init__(self, form: FrameFormat, values: int = 2) -> None:
        """Expect this number of values per frame. Bytes before the first whole frame are not counted."""
        super().__init__()
        self._form, self._payload = form, 2 * (values + form.counter)
        self._size = len(form.start) + self._payload + form.checksum
        self._least = self._size + (0 if form.checksum else len(form.start))
        self._in_step = False

    def feed(self, data: bytes) -> Iterator[PrintedRows]:
        """Yield the complete rows. Bytes between frames, and a wrong checksum, are a broken frame."""
        return self._split_at_broken(self._parse_frames(self._rest + data))

    def _parse_frames(self, received: bytes) -> Iterator[list[int]]:
        form, place = self._form, 0
        while len(received) - (begin := self._find_start(received, place)) >= self._least:
            payload = received[begin + len(form.start) :][: self._payload]
            good = not form.checksum or received[begin + self._size - 1] == sum(payload) & 0xFF
            if self._begun and (begin > place or not good):
                yield []
            if good:
                words = np.frombuffer(payload, "<i2").tolist()
                yield [words[0] & 0xFFFF, *words[1:]] if form.counter else words
            self._begun, place = self._begun or good, begin + (self._size if good else 1)
        self._rest = received[place:][-MAX_UNFRAMED_BYTES:]
        if self._begun and len(received) - place > MAX_UNFRAMED_BYTES:
            yield []

    def _find_start(self, received: bytes, place: int) -> int:
        """Return where the next frame begins, the end of these bytes if that is unknown."""
        if self._form.checksum:
            begin = received.find(self._form.start, place)
            return len(received) if begin < 0 else begin
        goes_on = all(received.startswith(self._form.start, at) for at in (place, place + self._size))
        if not (self._in_step and goes_on) and len(received) - place >= self._least:
            place = self._find_step(received, place)
            self._in_step = place < len(received)
        return place

    def _find_step(self, received: bytes, place: int) -> int:
        """Return the only place from which starts follow each other to the end, the end if there is none or several."""
        while len(received) - place >= self._size * (MIN_FRAMES_IN_STEP + 1):
            ends = {first: self._end_of_run(received, first) for first in range(place, place + self._size)}
            whole = [first for first, end in ends.items() if len(received) - end < len(self._form.start)]
            if whole:
                return whole[0] if len(whole) == 1 else len(received)
            place = max(max(ends.values()), place + self._size)
        return len(received)

    def _end_of_run(self, received: bytes, place: int) -> int:
        """Return the place after the frames from here on that begin with a start."""
        while received.startswith(self._form.start, place):
            place += self._size
        return place


class OutputFormat(NamedTuple):
    """Output format of a board."""

    adc_bits: int | None = None
    """Bits of the converter whose codes, from 0 up, are printed. None for volts."""
    frame: FrameFormat | None = None
    """Frame layout, None for text lines."""
    baud_rate: int = 115200
    """Rate of a serial port that is no USB device itself (baud)."""

    @property
    def bits(self) -> int:
        """Bits of the codes computed from the numbers: 24 for volts, so that nothing is lost."""
        return self.adc_bits or (16 if self.frame else 24)
