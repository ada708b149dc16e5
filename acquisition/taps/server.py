"""Device's end of a TAPS/1 wire."""

from __future__ import annotations

import json
import time
from typing import TYPE_CHECKING, Any

from acquisition.arrays import Codes
from acquisition.channel import Channel
from acquisition.taps.protocol import (
    LOST_BEFORE_FLAG,
    MAX_REASON_LENGTH,
    SAMPLE_BITS,
    DeviceStatus,
    Frame,
    FrameDecoder,
    HostileFrameError,
    MessageType,
    encode_data,
    encode_frame,
    max_scans_per_frame,
    parse_object,
)

if TYPE_CHECKING:
    from acquisition.emulation.emulated_device import Wire

STATUS_INTERVAL = 0.5
"""Time between STATUS frames (s)."""
START_BYTES = 8
"""Length of the body of START: the number of scans (u64)."""


class TapsServer:
    """Device's end of a TAPS/1 wire. It answers the commands of the host and counts the sent scans."""

    wire: Wire
    _channels: tuple[Channel, ...]
    _rate: float

    def _power_on(self) -> None:
        """Begin without a session or settings of a host."""
        self._decoder = FrameDecoder()
        self._seq = self._session = 0
        self._bits, self._per_frame = SAMPLE_BITS[0], 512
        self._begin_count(0)
        self._streaming = False

    def _begin_count(self, n_scans: int) -> None:
        """Begin to count the scans of a session of this many, 0 for endless."""
        self._streaming, self._lost, self._n_scans = True, False, n_scans
        self._scan = self._sent = self._overruns = self._peak = 0
        self._status_due = time.monotonic()

    def _info(self) -> dict[str, Any]:
        """Return the body of INFO."""
        raise NotImplementedError

    def _start(self, n_scans: int) -> None:
        """Start a session of this many scans, 0 for endless."""
        raise NotImplementedError

    def _stop(self) -> None:
        """End the session."""
        self._streaming = False

    def _configure(self, config: dict[str, Any]) -> None:
        if self._streaming:
            raise ValueError("CONFIG is not allowed while streaming. Send STOP first.")
        form, per_frame = config["format"], config["samples_per_frame"]
        is_possible = type(form) is type(per_frame) is int and 0 <= form < len(SAMPLE_BITS) and per_frame > 0
        expected = {"fs": self._rate, "channels": list(range(len(self._channels)))}
        if not is_possible or {key: config[key] for key in expected} != expected:
            raise ValueError(f"CONFIG {config} is not supported by this device")
        self._bits = SAMPLE_BITS[form]
        self._per_frame = min(per_frame, max_scans_per_frame(len(self._channels), self._bits))

    def _serve_host(self, timeout: float) -> None:
        """Send the pending bytes, then execute and answer the commands that have arrived."""
        for frame in self._decoder.feed(self.wire.exchange(timeout)):
            about = frame.seq.to_bytes(4, "little")
            try:
                if frame.type == MessageType.HELLO:
                    self._send(MessageType.INFO, json.dumps(self._info()).encode())
                    continue
                self._execute(frame)
                self._send(MessageType.ACK, about + b"\x00\x00")
            except (ValueError, LookupError, TypeError) as error:
                reason = str(error)[:MAX_REASON_LENGTH].encode(errors="replace")
                self._send(MessageType.NACK, about + b"\x01\x00" + reason)
                if isinstance(error, HostileFrameError):
                    self._refuse(error)
                    return

    def _refuse(self, error: HostileFrameError) -> None:
        """Act on hostile input after its NACK. A cable to a device has nothing to close."""

    def _execute(self, frame: Frame) -> None:
        """Execute a command. ValueError, LookupError or TypeError reject it."""
        if frame.type == MessageType.CONFIG:
            self._configure(parse_object(frame.body))
        elif frame.type == MessageType.START:
            if len(frame.body) != START_BYTES:
                raise HostileFrameError(f"START has a body of {len(frame.body)} bytes instead of {START_BYTES}")
            self._start(int.from_bytes(frame.body, "little"))
        elif frame.type == MessageType.STOP:
            self._stop()
        else:
            raise ValueError(f"unknown command {frame.type:#04x}")

    def _send(self, kind: MessageType, body: bytes = b"", flags: int = 0) -> None:
        self.wire.pending += encode_frame(Frame(kind, self._seq, body, self._session, flags))
        self._seq = (self._seq + 1) % 2**32

    def _send_data(self, codes: Codes, overload: int) -> None:
        """Send the next scans. Those lost before them are reported."""
        body = encode_data(self._scan, codes, self._bits, overload)
        self._send(MessageType.DATA, body, LOST_BEFORE_FLAG if self._lost else 0)
        self._lost = False
        self._sent += codes.shape[1]

    def _note_fill(self, capacity: int) -> None:
        """Note how full a buffer of this size (bytes) is."""
        self._peak = max(self._peak, min(100 * len(self.wire.pending) // capacity, 100))

    def _report_status(self, temperature: float) -> None:
        """Send the status if it is due. temperature: of the board (degC)."""
        now = time.monotonic()
        if now >= self._status_due:
            self._status_due = now + STATUS_INTERVAL
            status = DeviceStatus(self._scan, self._sent, self._peak, self._overruns, temperature)
            self._send(MessageType.STATUS, status.encode())
