"""Serve any device as a TAPS/1 device on TCP, so that a host elsewhere can read it."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from typing import Any

import numpy as np

from acquisition.channel import Block
from acquisition.emulation.emulated_device import TcpWire
from acquisition.errors import DeviceError, join_sentences
from acquisition.source import Device
from acquisition.taps import protocol
from acquisition.taps.protocol import FrameDecoder, HostileFrameError, MessageType
from acquisition.taps.server import TapsServer

BRIDGE_BUFFER_BYTES = 4 << 20
"""Bytes kept for a slow host: 20 s of two channels at 51.2 kHz and 16 bits. Later scans are dropped and reported."""
MAX_UNCLOCKED_BACKLOG_BYTES = 1 << 16
"""Backlog at which a device without a clock waits for its host (bytes). Nothing is dropped."""
MAX_DAMAGED_PIECES = 16
"""Damaged frames of one host at which its connection is closed, chosen. A probe of another driver sends a few."""
FIRST_FRAME_TIMEOUT = 10.0
"""Time for the first frame of a host (s), chosen. A silent host must not keep others out."""
REOPEN_INTERVAL = 0.5
"""Time between two attempts to reopen the device (s)."""


class TapsBridge(TapsServer):
    """TAPS/1 server for one device and one host at a time. It accepts no host while the device is away.

    Parameters
    ----------
    open_device
        Function that opens the device.
    tell
        Function called with a sentence when the device goes away or comes back, and when a host is disconnected.
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
        self.device, self._stopping = open_device(), False
        """Device, as opened last."""
        with ExitStack() as cleanup:
            cleanup.callback(self.device.close)
            self.wire: TcpWire = TcpWire(number, address)
            """Wire to the host."""
            cleanup.pop_all()
        self.port = self.wire.port
        """Port that the host opens."""

    def stop(self) -> None:
        """End `run`, from another thread."""
        self._stopping = True

    def run(self) -> None:
        """Serve until stopped or interrupted."""
        try:
            while not self._stopping:
                try:
                    self._serve()
                except DeviceError as error:
                    self.wire.close()
                    self.device.close()
                    self._tell(str(error))
                    self._wait()
        finally:
            self.wire.close()
            self.device.close()

    def _wait(self) -> None:
        """Wait until the device is back."""
        while not self._stopping:
            time.sleep(REOPEN_INTERVAL)
            try:
                self.device = self._open()
            except DeviceError:
                continue
            self.wire = TcpWire(int(self.port.rpartition(":")[2]), self._address)
            self._tell("the device is connected again")
            return

    def _serve(self) -> None:
        """Answer and send until stopped. DeviceError if the device goes away or falls silent."""
        self._channels, self._rate = self.device.channels, self.device.sample_rate
        self._power_on()
        while not self._stopping:
            if not self._streaming:
                self._answer(0.05)
                continue
            session = self._session
            for block in self.device.blocks():
                self._send_block(block)
                self._answer(0.0)
                while not self.device.follows_clock and len(self.wire.pending) > MAX_UNCLOCKED_BACKLOG_BYTES:
                    self._answer(0.05)
                if self._stopping or not self._streaming or session != self._session:
                    break
            else:
                self._streaming = False
        self._stop()

    def _answer(self, timeout: float) -> None:
        """Answer the host. One that sends no TAPS/1 is disconnected, so that the next one gets its turn."""
        had_host = self.wire.has_host
        self._serve_host(timeout)
        if not had_host:
            self._decoder = FrameDecoder()
            self._accepted_at = time.monotonic()
        if not self.wire.has_host:
            self._stop()
        elif fault := self._find_host_fault():
            self._refuse(HostileFrameError(fault))

    def _find_host_fault(self) -> str:
        """Return the fault of the bytes received so far from the host, empty without one."""
        if self._decoder.is_overlong:
            return f"a frame is longer than {protocol.MAX_FRAME} bytes"
        if self._decoder.dropped > MAX_DAMAGED_PIECES:
            return f"{self._decoder.dropped} frames are damaged"
        if len(self.wire.pending) > 2 * BRIDGE_BUFFER_BYTES:
            return f"{len(self.wire.pending)} bytes of answers are not read"
        if not self._decoder.accepted and time.monotonic() - self._accepted_at > FIRST_FRAME_TIMEOUT:
            return f"no frame within {FIRST_FRAME_TIMEOUT:g} s"
        return ""

    def _refuse(self, error: HostileFrameError) -> None:
        """Disconnect the host after sending the pending bytes that it reads."""
        text = f"the connection from {self.wire.host_address} was closed, because {error}"
        self._tell(join_sentences(text, "Check the program on that computer"))
        self.wire.exchange(0.0)
        self.wire.hang_up()
        self._stop()

    def _info(self) -> dict[str, Any]:
        clocked = self.device.follows_clock
        info = protocol.build_info(self.device.identity, self._channels, self._rate, follows_clock=clocked)
        return info | {"serial": info["serial"] or "no-number"}

    def _start(self, n_scans: int) -> None:
        self._stop()
        self.device.events.clear()
        self.device.start()
        self._session = (self._session + 1) % 2**16
        self._begin_count(n_scans)

    def _stop(self) -> None:
        if self._streaming:
            super()._stop()
            self.device.stop()

    def _send_block(self, block: Block) -> None:
        """Send the scans of a block, or drop them if the host is late. Scan indices show what is missing."""
        self._scan += block.lost_before
        self._lost = self._lost or block.lost_before > 0
        bits = np.array([channel.adc_bits for channel in self._channels], np.int32)
        codes = block.codes << (np.max(bits) - bits)[:, np.newaxis]
        if self._n_scans:
            codes = codes[:, : max(self._n_scans - self._scan, 0)]
        for begin in range(0, codes.shape[1], self._per_frame):
            part = codes[:, begin : begin + self._per_frame]
            if len(self.wire.pending) > BRIDGE_BUFFER_BYTES:
                self._overruns += not self._lost
                self._lost = True
            else:
                self._send_data(part, block.overload)
            self._scan += part.shape[1]
        while self.device.events:
            self._send(MessageType.EVENT, protocol.encode_event(self.device.events.popleft()))
        self._note_fill(BRIDGE_BUFFER_BYTES)
        self._report_status(protocol.NO_TEMPERATURE)
        if self._n_scans and self._scan >= self._n_scans:
            self._stop()
