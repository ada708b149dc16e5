"""A TAPS/1 device on a serial port as a source of scans."""

from __future__ import annotations

import json
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import replace
from types import TracebackType
from typing import Any, Self

from acquisition.channel import Block, Channel
from acquisition.errors import DeviceError
from acquisition.serial_link import SerialLink
from acquisition.taps import Frame, FrameDecoder, MessageType, decode_data, encode_frame

ANSWER_TIME = 1.0
"""How long a command may stay unanswered before it is sent again (s)."""
TRIES = 3
"""How often a command is sent."""
SILENCE = 3.0
"""A streaming device that sends no scans for so long has failed (s); it reports itself every 0.5 s."""
SCANS_PER_FRAME = 512
"""Asked of the device."""


class TapsSource:
    """Connects, asks the device who it is, configures it, and yields its scans. A context manager."""

    def __init__(self, port: str, sample_rate: float | None = None) -> None:
        """Open a port: a device name or socket://host:port. sample_rate None takes the device's highest (Hz).

        Raises DeviceError where there is no port or no TAPS/1 device, ValueError for a rate it does not have.
        """
        self._link = SerialLink(port)
        self._decoder = FrameDecoder()
        self._frames: deque[Frame] = deque()
        self._seq = 0
        self._session: int | None = None
        self._next_scan = 0
        self._streaming = False
        try:
            self._command(MessageType.STOP)
            self.info, self.channels = self._identify()
            self.sample_rate = self._configure(sample_rate)
        except BaseException:
            self._link.close()
            raise

    def __enter__(self) -> Self:
        """The connected source."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop the device and close the port."""
        self.close()

    @property
    def dropped_frames(self) -> int:
        """Damaged frames so far."""
        return self._decoder.dropped

    def start(self) -> None:
        """Begin an endless stream."""
        answer = self._command(MessageType.START, (0).to_bytes(8, "little"))
        self._session = answer.session
        self._next_scan = 0
        self._streaming = True

    def stop(self) -> None:
        """End the stream."""
        self._streaming = False
        self._session = None
        self._command(MessageType.STOP)

    def close(self) -> None:
        """Stop where the device still answers, then give the port back."""
        try:
            self._link.write(self._encode(MessageType.STOP))
        except DeviceError:
            pass
        finally:
            self._link.close()

    def blocks(self) -> Iterator[Block]:
        """Blocks with the scans lost before each; DeviceError where the device falls silent or is unplugged."""
        heard = time.monotonic()
        while self._streaming:
            frame = self._next_frame(0.1)
            if frame is not None and frame.type == MessageType.DATA and frame.session == self._session:
                heard = time.monotonic()
                yield self._block(frame)
            if time.monotonic() - heard > SILENCE:
                raise DeviceError(
                    f"the DAQ on {self._link.port} has sent no samples for {SILENCE:g} s; "
                    "switch it off and on and give the same command again"
                )

    def _block(self, frame: Frame) -> Block:
        block = decode_data(frame.body)
        lost = max(block.first_scan - self._next_scan, 0)
        self._next_scan = block.first_scan + block.codes.shape[1]
        return replace(block, lost_before=lost)

    def _identify(self) -> tuple[dict[str, Any], tuple[Channel, ...]]:
        body = self._command(MessageType.HELLO, answer=MessageType.INFO).body
        try:
            info = json.loads(body)
            channels = _channels(info)
            info["model"], info["fs_choices"] = str(info["model"]), [float(rate) for rate in info["fs_choices"]]
        except (ValueError, KeyError, TypeError) as error:
            raise DeviceError(
                f"the DAQ on {self._link.port} describes itself wrongly ({type(error).__name__}: {error}); "
                "its firmware must send the INFO of TAPS/1"
            ) from error
        return info, channels

    def _configure(self, sample_rate: float | None) -> float:
        choices = self.info["fs_choices"]
        rate = max(choices) if sample_rate is None else sample_rate
        if rate not in choices:
            listed = ", ".join(f"{choice:g}" for choice in choices)
            raise ValueError(f"sample rate {rate:g} Hz is none of this device's: {listed} Hz")
        wish = {
            "fs": rate,
            "channels": list(range(len(self.channels))),
            "format": 0 if self.info["adc_bits"] <= 16 else 2,
            "samples_per_frame": SCANS_PER_FRAME,
        }
        self._command(MessageType.CONFIG, json.dumps(wish).encode())
        return float(rate)

    def _encode(self, kind: MessageType, body: bytes = b"") -> bytes:
        self._seq += 1
        return encode_frame(Frame(kind, self._seq, body))

    def _command(self, kind: MessageType, body: bytes = b"", answer: MessageType = MessageType.ACK) -> Frame:
        """Send, and wait for ACK of this command, or for the one frame it asks for."""
        for _ in range(TRIES):
            self._link.write(self._encode(kind, body))
            deadline = time.monotonic() + ANSWER_TIME
            while (left := deadline - time.monotonic()) > 0:
                frame = self._next_frame(left)
                if frame is not None and self._answers(frame, answer):
                    return frame
        raise DeviceError(
            f"no TAPS/1 device answers on {self._link.port} ({kind.name}, {TRIES} tries); "
            "check that this is the DAQ's port and that it is switched on"
        )

    def _next_frame(self, timeout: float) -> Frame | None:
        """The next frame in order of arrival; None where nothing came in time (s)."""
        if not self._frames:
            self._frames.extend(self._decoder.feed(self._link.read(timeout)))
        return self._frames.popleft() if self._frames else None

    def _answers(self, frame: Frame, answer: MessageType) -> bool:
        about = int.from_bytes(frame.body[:4], "little")
        if frame.type == MessageType.NACK and about == self._seq:
            raise DeviceError(
                f"the DAQ on {self._link.port} refuses a command: {frame.body[6:].decode(errors='replace')}"
            )
        return frame.type == answer and (answer != MessageType.ACK or about == self._seq)


def _channels(info: dict[str, Any]) -> tuple[Channel, ...]:
    """Channels as the device reports them; sens_V_per_EU is V per N or V per m/s^2, before its gain."""
    return tuple(
        Channel(
            quantity=entry["quantity"],
            sensitivity=entry["sens_V_per_EU"] * entry.get("gain", 1.0),
            full_scale=entry["fs_V"],
            adc_bits=info["adc_bits"],
            calibration_date=entry.get("sens_date", ""),
            skew=entry.get("skew_s", 0.0),
        )
        for entry in info["channels"]
    )
