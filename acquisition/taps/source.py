"""Read scans from a TAPS/1 device on a serial port or TCP."""

import contextlib
import json
import struct
import time
from collections import deque
from collections.abc import Iterator
from typing import Any

from acquisition.channel import Block, Channel
from acquisition.errors import DeviceError, check_name
from acquisition.ports.serial_ports import SILENCE_TIMEOUT, SerialLink
from acquisition.source import ClosedOnExit, DeviceIdentity, Event
from acquisition.taps import protocol
from acquisition.taps.protocol import SAMPLE_BITS, DeviceStatus, EventLog, Frame, FrameDecoder, MessageType

TAPS_PROBE_TIMEOUT = 1.0
"""Time to wait for an answer to HELLO (s)."""


def probe_taps(link: SerialLink) -> DeviceIdentity | None:
    """Send HELLO once and return the device that answers.

    Parameters
    ----------
    link
        Open serial link.

    Returns
    -------
    DeviceIdentity or None
        Identity from INFO, None if no TAPS/1 device answers.
    """
    decoder = FrameDecoder()
    hello = protocol.encode_frame(Frame(MessageType.HELLO))
    link.write(b"\x00" + hello)  # the zero ends a partial command of another program
    deadline = time.monotonic() + TAPS_PROBE_TIMEOUT
    while (remaining := deadline - time.monotonic()) > 0:
        for frame in decoder.feed(link.read(remaining)):
            if frame.type == MessageType.INFO:
                try:
                    return parse_identity(protocol.parse_object(frame.body))
                except ValueError:
                    return None
    return None


def parse_identity(info: dict[str, Any]) -> DeviceIdentity:
    """Return the identity of the device that sent this INFO."""
    words = [str(info.get(key) or "") for key in ("model", "serial", "fw")]
    for word in words:
        check_name(word, "INFO")
    return DeviceIdentity(*words, knows_sensors=bool(info.get(protocol.KNOWS_SENSORS_KEY)))


MAX_SCANS = 2**53
"""Scan index that no stream reaches: 28 years at MAX_SAMPLE_RATE. Larger numbers are not exact as floats."""
MAX_SAMPLE_RATE = 1e7
"""Highest sample rate that a device may offer (Hz), chosen: a hundred times that of a tap test."""


class ScanStream:
    """Scans of one TAPS/1 session: each at most once, missing ones counted."""

    def __init__(self, session: int, n_channels: int) -> None:
        """Expect the session that the ACK of START names, with this number of channels."""
        self._session, self._n_channels = session, n_channels
        self._next_scan = 0
        self.lost_scans = 0
        """Number of scans that never arrived."""
        self.refused = 0
        """Number of DATA frames of this session that were repeated, late or contradictory."""
        self.foreign = 0
        """Number of DATA frames of other sessions since the last one of this session."""

    def accept(self, frame: Frame) -> Block | None:
        """Return the block of a DATA frame with the scans lost before it. None if the frame is rejected.

        A jump of the index shows how many scans are missing. If the device reports a loss without a jump, one lost scan
        is counted, so that no hit with the gap is accepted.
        """
        if frame.session != self._session:
            self.foreign += 1
            return None
        try:
            block = protocol.decode_data(frame.body)
        except ValueError:
            block = None
        expected = range(self._next_scan, MAX_SCANS)
        fits = block is not None and block.codes.size and block.codes.shape[0] == self._n_channels
        if block is None or not fits or block.first_scan not in expected:
            self.refused += 1
            return None
        lost = block.first_scan - self._next_scan or int(bool(frame.flags & protocol.LOST_BEFORE_FLAG))
        self._next_scan = block.first_scan + block.codes.shape[1]
        self.lost_scans += lost
        self.foreign = 0
        return Block(block.first_scan, block.codes, block.overload, lost)


TAPS_ANSWER_TIMEOUT = 1.0
"""Time after which an unanswered command is sent again (s)."""
TAPS_COMMAND_TRIES = 3
"""Number of times a command is sent."""
MIN_SCANS_PER_FRAME = 512
"""Scans per frame requested from the device, if as many fit into a frame."""
TARGET_FRAME_TIME = 0.01
"""Duration of a frame requested at higher sample rates (s)."""


class TapsSource(ClosedOnExit):
    """Connection to a TAPS/1 device as a source of scans. A context manager.

    Parameters
    ----------
    port
        Serial device name or socket://host:port.
    sample_rate
        Sample rate (Hz), None for the highest of the device.

    Raises
    ------
    DeviceError
        There is no port or no TAPS/1 device.
    ValueError
        The device does not have this sample rate.
    """

    loss_detection = "scan numbers"
    """Method by which lost scans are detected."""
    _frame_time = TARGET_FRAME_TIME

    def __init__(self, port: str, sample_rate: float | None = None) -> None:
        self._link = SerialLink(port)
        self._decoder = FrameDecoder()
        self._frames: deque[Frame] = deque()
        self._seq, self._streaming = 0, False
        self._events = EventLog()
        self.events: deque[Event] = self._events.new
        """Events at the device, oldest first. Take them with popleft() in any thread (IndexError if empty)."""
        self._stream: ScanStream | None = None
        self.status: DeviceStatus | None = None
        """Status that the device reported last, every 0.5 s of a stream."""
        try:
            self._command(MessageType.STOP)
            self._info, self.channels = self._identify()
            self.follows_clock = self._info.get("clock_ppm", 0) is not None
            self.sample_rate = self._configure(sample_rate)
        except BaseException:
            self._link.close()
            raise

    @property
    def fault(self) -> str:
        """Broken cable or unpowered sensor and its remedy while it lasts, empty if there is none."""
        numbers = (entry["i"] for entry in self._info["channels"])
        return self._events.fault(dict(zip(numbers, self.channels, strict=True)))

    @property
    def lost_scans(self) -> int:
        """Number of scans of this or the last stream that never arrived."""
        return self._stream.lost_scans if self._stream else 0

    @property
    def dropped_frames(self) -> int:
        """Number of damaged frames so far, and of repeated or late DATA frames of this stream."""
        return self._decoder.dropped + (self._stream.refused if self._stream else 0)

    @property
    def overruns(self) -> int:
        """Number of times received data was discarded because this program was late."""
        return self._link.overruns

    def start(self) -> None:
        """Start an endless stream."""
        self.status = None
        answer = self._command(MessageType.START, (0).to_bytes(8, "little"))
        self._stream = ScanStream(answer.session, len(self.channels))
        self._streaming = True

    def stop(self) -> None:
        """End the stream. Call it in the thread that reads the blocks."""
        self._streaming = False
        self._command(MessageType.STOP)

    def close(self) -> None:
        """Stop the device if it still answers, and close the port."""
        with contextlib.closing(self._link), contextlib.suppress(DeviceError):
            self._link.write(self._encode(MessageType.STOP))

    def blocks(self) -> Iterator[Block]:
        """Yield blocks with the scans lost before each. DeviceError if the device falls silent or is unplugged."""
        last_arrival = time.monotonic()
        while self._stream is not None and self._streaming:
            frame = self._next_frame(0.1)
            if frame is not None and frame.type == MessageType.DATA:
                block = self._stream.accept(frame)
                if block is not None:
                    yield block
                    last_arrival = time.monotonic()  # not before: a slow consumer is no silent device
            if time.monotonic() - last_arrival > SILENCE_TIMEOUT:
                is_foreign = bool(self._stream.foreign)
                silent = f"has sent no samples for {SILENCE_TIMEOUT:g} s"
                text = f"the DAQ on {self._link.port} {'started another stream on its own' if is_foreign else silent}"
                raise DeviceError(text, "Switch the DAQ off and on, then repeat the command")

    def _identify(self) -> tuple[dict[str, Any], tuple[Channel, ...]]:
        """Ask for INFO. DeviceError if it cannot be used."""
        body = self._command(MessageType.HELLO, answer=MessageType.INFO).body
        try:
            info = protocol.parse_object(body)
            channels = _parse_channels(info)
            rates = [float(rate) for rate in info["fs_choices"]]
            if not rates or not all(0 < rate <= MAX_SAMPLE_RATE for rate in rates):
                raise ValueError(
                    f"fs_choices={info['fs_choices']} must be sample rates above 0, at most {MAX_SAMPLE_RATE:g} Hz"
                )
            info["fs_choices"] = rates
            for key in ("model", "serial"):
                if not info[key]:
                    raise ValueError(f"{key} is empty")
            self.identity = parse_identity(info)
        except (ValueError, LookupError, TypeError, AttributeError, ArithmeticError) as error:
            text = f"the DAQ on {self._link.port} sends invalid channel data ({type(error).__name__}: {error})"
            raise DeviceError(text, "Update the firmware of the DAQ. It must send the INFO frame of TAPS/1") from error
        return info, channels

    def _configure(self, sample_rate: float | None) -> float:
        choices = self._info["fs_choices"]
        rate = max(choices) if sample_rate is None else sample_rate
        if rate not in choices:
            listed = ", ".join(f"{choice:g}" for choice in choices)
            raise ValueError(f"sample rate {rate:g} Hz is not one of {listed} Hz, the rates of this device")
        form = next(form for form, bits in enumerate(SAMPLE_BITS) if self._info["adc_bits"] <= bits)
        channels = [entry["i"] for entry in self._info["channels"]]
        fit = protocol.max_scans_per_frame(len(channels), SAMPLE_BITS[form])
        scans = min(max(MIN_SCANS_PER_FRAME, round(self._frame_time * rate)), fit)
        config = {"fs": rate, "channels": channels, "format": form, "samples_per_frame": scans}
        self._command(MessageType.CONFIG, json.dumps(config).encode())
        return float(rate)

    def _encode(self, kind: MessageType, body: bytes = b"") -> bytes:
        self._seq += 1
        return protocol.encode_frame(Frame(kind, self._seq, body))

    def _command(self, kind: MessageType, body: bytes = b"", answer: MessageType = MessageType.ACK) -> Frame:
        """Send a command and wait for its ACK, or for the one frame it requests."""
        for _ in range(TAPS_COMMAND_TRIES):
            self._link.write(self._encode(kind, body))
            deadline = time.monotonic() + TAPS_ANSWER_TIMEOUT
            while (remaining := deadline - time.monotonic()) > 0:
                frame = self._next_frame(remaining)
                if frame is not None and self._answers(frame, answer):
                    return frame
        text = f"no TAPS/1 device answers on {self._link.port} ({kind.name}, {TAPS_COMMAND_TRIES} tries)"
        raise DeviceError(text, "Check that this is the port of the DAQ and that the DAQ is switched on")

    def _next_frame(self, timeout: float) -> Frame | None:
        """Return the next frame in order of arrival, None after the timeout (s)."""
        if not self._frames:
            self._frames.extend(self._decoder.feed(self._link.read(timeout)))
        if not self._frames:
            return None
        frame = self._frames.popleft()
        if frame.type == MessageType.EVENT:
            self._events.add(frame)
        elif frame.type == MessageType.STATUS:
            with contextlib.suppress(struct.error):
                self.status = DeviceStatus.decode(frame.body)
        return frame

    def _answers(self, frame: Frame, answer: MessageType) -> bool:
        about = int.from_bytes(frame.body[:4], "little")
        if frame.type == MessageType.NACK and about == self._seq:
            text = frame.body[6 : 6 + protocol.MAX_REASON_LENGTH].decode(errors="replace")
            raise DeviceError(f"the DAQ on {self._link.port} rejects a command ({text})")
        return frame.type == answer and (answer != MessageType.ACK or about == self._seq)


def _parse_channels(info: dict[str, Any]) -> tuple[Channel, ...]:
    """Return the channels that the device reports. sens_V_per_EU is V per N or V per m/s^2, before its gain.

    Raises KeyError, TypeError or ValueError if they are invalid.
    """
    if not 2 <= info["adc_bits"] <= SAMPLE_BITS[-1]:
        raise ValueError(f"adc_bits={info['adc_bits']} is not between 2 and {SAMPLE_BITS[-1]}")
    if not info["channels"]:
        raise ValueError("channels is empty")
    for entry in info["channels"]:
        for key in ("sensor_serial", "sens_date"):
            check_name(str(entry.get(key) or ""), key)
    if len({entry["i"] for entry in info["channels"]}) != len(info["channels"]):
        raise ValueError("two channels have the same number (key i)")
    return tuple(
        Channel(
            quantity=entry["quantity"],
            sensitivity=entry["sens_V_per_EU"] * entry.get("gain", 1.0),
            full_scale=entry["fs_V"],
            adc_bits=info["adc_bits"],
            direction=entry.get("direction") or "",
            serial_number=str(entry.get("sensor_serial") or ""),
            calibration_date=str(entry.get("sens_date") or ""),
            skew=entry.get("skew_s", 0.0),
        )
        for entry in info["channels"]
    )
