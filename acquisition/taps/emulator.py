"""Emulate a TAPS/1 device and its faults on a pseudo-terminal or TCP port."""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from acquisition.channel import Channel
from acquisition.emulation.emulated_device import EmulatorThread, SignalFunction, quantise
from acquisition.source import DeviceIdentity, Event, EventKind
from acquisition.taps import protocol
from acquisition.taps.protocol import MessageType
from acquisition.taps.server import TapsServer

NOISE_BYTES = bytes(range(7, 71)) + b"\x00" + bytes(range(200, 230))
"""Bytes that are no frame. Their end damages the next frame."""


@dataclass(frozen=True)
class TapsFaults:
    """Faults of an emulated TAPS/1 device and its cable. All are off by default."""

    unplug_after: int | None = None
    """Number of scans after which the device hangs up within a frame."""
    stall_after: int | None = None
    """Number of scans after which it sends nothing more."""
    restart_after: int | None = None
    """Number of scans after which it starts another session by itself, once."""
    drop_every: int | None = None
    """Period in DATA frames at which one is lost on the wire."""
    corrupt_every: int | None = None
    """Period at which one byte of a frame is altered."""
    duplicate_every: int | None = None
    """Period at which a frame is sent twice."""
    cut_every: int | None = None
    """Period at which a frame lacks its second half and delimiter, which damages the next frame too."""
    noise_every: int | None = None
    """Period at which noise before a frame damages it."""
    noise_at_start: bool = False
    """True if noise precedes the first answer."""
    start_streaming: bool = False
    """True if the device streams already when the host connects."""
    cut_infos: int = 0
    """Number of INFO answers that lack their second half."""
    overload: int = 0
    """Mask of channels that every DATA frame reports as overloaded."""

    def apply(self, encoded: bytes, count: int) -> bytes:
        """Return the bytes that arrive for a DATA frame.

        Parameters
        ----------
        encoded
            Bytes of the frame as sent.
        count
            Number of the DATA frame, from 1.
        """
        if _is_due(self.drop_every, count):
            return b""
        if _is_due(self.corrupt_every, count):
            encoded = encoded[:40] + bytes([encoded[40] ^ 0x55 or 1]) + encoded[41:]
        if _is_due(self.cut_every, count):
            encoded = encoded[: len(encoded) // 2]
        if _is_due(self.duplicate_every, count):
            encoded *= 2
        return NOISE_BYTES + encoded if _is_due(self.noise_every, count) else encoded


def _is_due(period: int | None, count: int) -> bool:
    return period is not None and count % period == 0


EMULATOR_IDENTITY = DeviceIdentity("lobewatch emulator", "EMU-1", "1.0")
"""Identity that the emulator reports."""
TAPS_BUFFER_SECONDS = 1.0
"""Samples kept for a slow host before scans are dropped (s)."""


class TapsEmulator(TapsServer, EmulatorThread):
    """Emulated TAPS/1 device. A context manager whose `port` opens like a real one.

    Parameters
    ----------
    signal
        Function (first_scan, n_scans) that returns values in N and m/s^2, shape (n_channels, n_scans).
    channels
        Channels of the device.
    sample_rate
        Sample rate (Hz).
    realtime
        Whether it sends by the clock. False sends as fast as the host reads.
    tcp
        Whether it listens on loopback instead of a pseudo-terminal.
    link
        Path that always leads to the pseudo-terminal, also after `replug`, like /dev/serial/by-id.
    faults
        Faults to inject, None for none.
    clock
        Clock that scans follow (s).
    knows_sensors
        Whether it says that its sensitivities are the true ones of its signals.

    Examples
    --------
    >>> spindle = Structure(np.array([500.0]), np.array([0.02]), np.array([2e7]))
    >>> tapped = HammeredStructure(spindle, 10240.0, np.random.default_rng(1))
    >>> sensors = Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1e-3, 5.0)
    >>> with TapsEmulator(tapped, sensors, 10240.0, realtime=False) as device, TapsSource(device.port) as source:
    ...     source.start()
    ...     block = next(source.blocks())
    >>> block.first_scan, block.codes.shape[0]
    (0, 2)
    """

    def __init__(
        self,
        signal: SignalFunction,
        channels: tuple[Channel, ...],
        sample_rate: float,
        *,
        realtime: bool = True,
        tcp: bool = False,
        link: Path | None = None,
        faults: TapsFaults | None = None,
        clock: Callable[[], float] = time.monotonic,
        knows_sensors: bool = False,
    ) -> None:
        super().__init__(tcp, link)
        self._time = clock
        self._signal, self._channels, self._rate = signal, channels, sample_rate
        self._realtime, self._faults = realtime, faults or TapsFaults()
        self._identity = replace(EMULATOR_IDENTITY, knows_sensors=knows_sensors)
        self._clock, self._restarted = 0, False
        self._pending_events: deque[Event] = deque()
        self._active_faults: dict[tuple[int, int | None], Event] = {}
        self._power_on()

    def _power_on(self) -> None:
        super()._power_on()
        self._frames = self._infos = 0
        if self._faults.noise_at_start:
            self.wire.pending += NOISE_BYTES
        if self._faults.start_streaming:
            self._start(0)

    def replug(self) -> None:
        """Plug the device in again: powered on, not configured. The signal continues where it was.

        The TCP port and `link` stay. A pseudo-terminal gets a new name, see `port`. `unplug_after` is switched off.
        """
        self.unplug()
        self._faults = replace(self._faults, unplug_after=None)
        self.plug_in()
        self._power_on()
        self.serve()

    def send_event(self, event: Event) -> None:
        """Send an event now. Its scan is filled in here. An active fault is sent again at START.

        Parameters
        ----------
        event
            Pressed button or cable fault.
        """
        self._pending_events.append(event)

    def serve_once(self) -> bool:
        self._serve_host(0.0 if self._streaming and self._has_room() else 0.05)
        while self._pending_events:
            event = self._pending_events.popleft()
            if event.kind != EventKind.BUTTON:
                self._active_faults[event.kind, event.channel] = event
            self._send(MessageType.EVENT, protocol.encode_event(replace(event, scan=self._scan)))
        if self._streaming:
            self._stream()
        if self._faults.unplug_after is None or self._scan < self._faults.unplug_after:
            return True
        self._end_within_a_frame()
        return False

    def _end_within_a_frame(self) -> None:
        del self.wire.pending[-self._per_frame :]
        for _ in range(20):
            if not self.wire.pending:
                break
            self.wire.exchange(0.05)

    def _send(self, kind: MessageType, body: bytes = b"", flags: int = 0) -> None:
        place = len(self.wire.pending)
        super()._send(kind, body, flags)
        encoded = bytes(self.wire.pending[place:])
        if kind == MessageType.DATA:
            self._frames += 1
            self.wire.pending[place:] = self._faults.apply(encoded, self._frames)
        elif kind == MessageType.INFO:
            self._infos += 1
            if self._infos <= self._faults.cut_infos:
                del self.wire.pending[place + len(encoded) // 2 :]

    def _info(self) -> dict[str, Any]:
        return protocol.build_info(self._identity, self._channels, self._rate, follows_clock=self._realtime)

    def _start(self, n_scans: int) -> None:
        """Start a session and report active faults."""
        self._session = (self._session + 1) % 0x10000
        self._begin_count(n_scans)
        self._started = self._time()
        self._pending_events.extend(event for event in self._active_faults.values() if event.begins)

    def _stream(self) -> None:
        """Send the frames that are due, drop them if the host is late, report from time to time."""
        if self._is_blocked():
            return
        due = int((self._time() - self._started) * self._rate) if self._realtime else self._scan + self._per_frame
        while self._scan + self._per_frame <= due:
            self._send_scans(overrun=not self._has_room())
        self._report_status(31.5)
        if self._realtime:
            time.sleep(0.5 * self._per_frame / self._rate)

    def _is_blocked(self) -> bool:
        faults = self._faults
        if faults.restart_after is not None and self._scan >= faults.restart_after and not self._restarted:
            self._restarted = True
            self._start(0)
        stalled = faults.stall_after is not None and self._scan >= faults.stall_after
        return stalled or not (self._realtime or self._has_room())

    def _has_room(self) -> bool:
        """Return whether the buffer takes another frame. Not in real time, little is sent ahead of the host."""
        return len(self.wire.pending) <= self._buffer_bytes()

    def _buffer_bytes(self) -> int:
        scan_bytes = self._bits // 8 * len(self._channels)
        return int(TAPS_BUFFER_SECONDS * self._rate) * scan_bytes if self._realtime else 1 << 16

    def _send_scans(self, overrun: bool) -> None:
        codes = quantise(self._signal(self._clock, self._per_frame), self._channels)
        self._clock += self._per_frame
        if overrun:
            self._lost = True
            self._overruns += 1
        else:
            self._send_data(codes, self._faults.overload)
            self._note_fill(self._buffer_bytes())
        self._scan += self._per_frame
        if self._n_scans and self._scan >= self._n_scans:
            self._streaming = False
