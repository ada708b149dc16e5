"""Serve any device as a TAPS/1 device on TCP, so that a host elsewhere can read it."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from acquisition.channel import Block
from acquisition.emulation.emulated_device import TcpWire
from acquisition.errors import DeviceError
from acquisition.source import Device
from acquisition.taps.protocol import (
    LOST_BEFORE_FLAG,
    NO_TEMPERATURE,
    SAMPLE_BITS,
    STATUS_INTERVAL,
    DeviceCommands,
    DeviceStatus,
    Frame,
    FrameDecoder,
    MessageType,
    build_info,
    encode_data,
    encode_event,
    encode_frame,
    parse_sample_bits,
)

BRIDGE_BUFFER_BYTES = 4 << 20
"""Bytes kept for a slow host: 20 s of two channels at 51.2 kHz and 16 bits. Later scans are dropped and reported."""
MAX_UNCLOCKED_BACKLOG_BYTES = 1 << 16
"""Backlog at which a device without a clock waits for its host (bytes). Nothing is dropped."""
REOPEN_INTERVAL = 0.5
"""Time between two attempts to reopen the device (s)."""
NO_SERIAL_NUMBER = "no-number"
"""Serial number that INFO names for a device without one."""


class TapsBridge:
    """TAPS/1 server for one device and one host at a time. It accepts no host while the device is away.

    Parameters
    ----------
    open_device
        Function that opens the device.
    tell
        Function called with a sentence when the device goes away or comes back.
    address
        Address of this computer to listen at.
    number
        TCP port number, 0 for a free one.

    Raises
    ------
    DeviceError
        There is no device.
    OSError
        The bridge cannot listen at this address.
    """

    def __init__(
        self,
        open_device: Callable[[], Device],
        tell: Callable[[str], None],
        *,
        address: str = "127.0.0.1",
        number: int = 0,
    ) -> None:
        self._open, self._tell, self._address = open_device, tell, address
        self._device = open_device()
        self._stopping = False
        try:
            self._listen(number)
        except OSError:
            self._device.close()
            raise

    @property
    def port(self) -> str:
        """Port that the host opens."""
        return self._wire.port

    @property
    def device(self) -> Device:
        """Device, as opened last."""
        return self._device

    def stop(self) -> None:
        """End `run`, from another thread."""
        self._stopping = True

    def run(self) -> None:
        """Serve until stopped or interrupted."""
        try:
            while not self._stopping:
                try:
                    _BridgeSession(self._device, self._wire).serve(lambda: self._stopping)
                except DeviceError as error:
                    self._wire.close()
                    self._device.close()
                    self._tell(str(error))
                    self._wait()
        finally:
            self._wire.close()
            self._device.close()

    def _listen(self, number: int) -> None:
        self._wire = TcpWire(number, self._address)

    def _wait(self) -> None:
        """Wait until the device is back."""
        while not self._stopping:
            time.sleep(REOPEN_INTERVAL)
            try:
                self._device = self._open()
            except DeviceError:
                continue
            self._listen(int(self.port.rpartition(":")[2]))
            self._tell("the device is back")
            return


class _BridgeSession:
    """Device and the wire to its host."""

    def __init__(self, device: Device, wire: TcpWire) -> None:
        self._device, self._wire, self._decoder = device, wire, FrameDecoder()
        self._commands = DeviceCommands(self._info, self._configure, self._start, self._stop)
        self._bits, self._per_frame = SAMPLE_BITS[0], 512
        self._shift = [max(channel.adc_bits for channel in device.channels) - c.adc_bits for c in device.channels]
        self._seq = self._session = self._limit = 0
        self._streaming = False

    def serve(self, is_over: Callable[[], bool]) -> None:
        """Answer and send until `is_over`. DeviceError if the device goes away or falls silent."""
        while not is_over():
            if not self._streaming:
                self._answer(0.05)
                continue
            session = self._session
            for block in self._device.blocks():
                self._send_block(block)
                self._answer(0.0)
                while not self._device.follows_clock and len(self._wire.pending) > MAX_UNCLOCKED_BACKLOG_BYTES:
                    self._answer(0.05)
                if is_over() or not self._streaming or session != self._session:
                    break
            else:
                self._streaming = False
        self._stop()

    def _answer(self, timeout: float) -> None:
        for frame in self._decoder.feed(self._wire.exchange(timeout)):
            self._send(*self._commands.answer(frame))
        if not self._wire.has_host:
            self._decoder = FrameDecoder()
            self._stop()

    def _send(self, kind: MessageType, body: bytes, flags: int = 0) -> None:
        self._wire.pending += encode_frame(Frame(kind, self._seq, body, self._session, flags))
        self._seq = (self._seq + 1) % 2**32

    def _info(self) -> dict[str, Any]:
        device = self._device
        info = build_info(device.identity, device.channels, device.sample_rate, follows_clock=device.follows_clock)
        return info | {"serial": info["serial"] or NO_SERIAL_NUMBER}

    def _configure(self, wish: dict[str, Any]) -> None:
        if self._streaming:
            raise ValueError("CONFIG while streaming; send STOP first")
        self._bits = parse_sample_bits(wish, self._device.channels, self._device.sample_rate)
        self._per_frame = int(wish["samples_per_frame"])

    def _start(self, n_scans: int) -> None:
        self._stop()
        self._device.events.clear()
        self._device.start()
        self._session, self._limit, self._streaming = (self._session + 1) % 2**16, n_scans, True
        self._next = self._sent = self._overruns = self._peak = 0
        self._lost, self._status_due = False, 0.0

    def _stop(self) -> None:
        if self._streaming:
            self._streaming = False
            self._device.stop()

    def _send_block(self, block: Block) -> None:
        """Send the scans of a block, or drop them if the host is late. Scan indices show what is missing."""
        self._next += block.lost_before
        self._lost = self._lost or block.lost_before > 0
        codes = block.codes << np.array(self._shift, np.int32)[:, np.newaxis]
        if self._limit:
            codes = codes[:, : max(self._limit - self._next, 0)]
        for begin in range(0, codes.shape[1], self._per_frame):
            part = codes[:, begin : begin + self._per_frame]
            if len(self._wire.pending) > BRIDGE_BUFFER_BYTES:
                self._overruns += not self._lost
                self._lost = True
            else:
                body = encode_data(self._next, part, self._bits, block.overload)
                self._send(MessageType.DATA, body, LOST_BEFORE_FLAG if self._lost else 0)
                self._lost = False
                self._sent += part.shape[1]
            self._next += part.shape[1]
        self._report()
        if self._limit and self._next >= self._limit:
            self._stop()

    def _report(self) -> None:
        """Send events, and the status from time to time."""
        while self._device.events:
            self._send(MessageType.EVENT, encode_event(self._device.events.popleft()))
        self._peak = max(self._peak, min(100 * len(self._wire.pending) // BRIDGE_BUFFER_BYTES, 100))
        if time.monotonic() >= self._status_due:
            self._status_due = time.monotonic() + STATUS_INTERVAL
            status = DeviceStatus(self._next, self._sent, self._peak, self._overruns, NO_TEMPERATURE)
            self._send(MessageType.STATUS, status.encode())
