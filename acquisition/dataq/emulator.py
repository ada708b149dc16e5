"""Emulate a DATAQ device on a pseudo-terminal or a TCP port, byte for byte."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acquisition.channel import SensorInput
from acquisition.dataq import protocol
from acquisition.dataq.protocol import DEC_LIMITS, DECA_LIMITS, DIGITAL_INPUTS_CODE, SRATE_LIMITS
from acquisition.dataq.stream import CLOCK_BIT
from acquisition.emulation.emulated_device import EmulatorThread, SignalFunction
from acquisition.source import EMULATED_SERIAL

DATAQ_BUFFER_SECONDS = 1.0
"""Samples kept for a slow host before the device stops (s)."""
MAX_SCANS_PER_STEP = 512
"""Scans generated at a time, at most."""
PARAMETER_LIMITS = {"srate": SRATE_LIMITS, "dec": DEC_LIMITS, "deca": DECA_LIMITS, "ps": (0, 7), "encode": (0, 1)}
"""Smallest and largest argument of each command with a number."""
UNKNOWN_COMMAND_REPLY, INVALID_PARAMETER_REPLY = protocol.REFUSAL_REPLIES[:2]


@dataclass(frozen=True)
class DataqTraits:
    """Properties of the device. Defaults from `trailing_nul` on are assumptions that no real device has confirmed."""

    model: str = "4108"
    """Answer to `info 1`."""
    firmware: str = "1.35"
    """Answer to `info 2`. Some devices answer in hexadecimal hundredths, "87"."""
    trailing_nul: bool = False
    """True if lines end with CR NUL instead of CR."""
    digital_word: int = 0x7F00
    """Word of the digital inputs, pulled up if nothing is connected."""
    clock_hz: float | None = None
    """Frequency of a square wave on digital input 0 (Hz)."""
    bits: int = 16
    """Resolution (bits). The lower bits of each word are 0. The devices have fewer than 16 at high rates."""
    is_multiplexed: bool = False
    """True if inputs are converted one after the other within a scan."""
    echoes_stop: bool = False
    """True if a `stop` that ends scanning is echoed."""
    stop_delay: float = 0.0
    """Silence before that echo and before the remaining data (s)."""


@dataclass(frozen=True)
class DataqFaults:
    """Faults of an emulated DATAQ device. All are off by default."""

    halved_rate: bool = False
    """True if scans come at half the rate of the formula."""
    drop_at: int | None = None
    """Byte of the stream at which bytes are lost."""
    drop_bytes: int = 64
    """Number of bytes lost there."""
    stall_after: int | None = None
    """Number of scans after which it sends nothing more."""
    unplug_after: int | None = None
    """Number of scans after which it hangs up."""
    overflow_after: int | None = None
    """Number of scans after which its buffer overflows, once."""
    streaming_at_connect: bool = False
    """True if an earlier program has left it scanning."""
    ignores_commands: bool = False
    """True if it ignores all commands."""


class DataqEmulator(EmulatorThread):
    """Emulated DATAQ device. A context manager whose `port` opens like a real one.

    Parameters
    ----------
    signal_at
        Function that returns, for the rate the host has chosen (Hz), the signal function of the sensors.
    inputs
        Sensors, in the order of the signal's rows.
    realtime
        Whether it sends by the clock. False sends as fast as the host reads.
    tcp
        Whether it listens on loopback instead of a pseudo-terminal.
    traits
        Properties of the device, None for the defaults.
    faults
        Faults to inject, None for none.
    clock
        Clock that scans follow (s).
    """

    def __init__(
        self,
        signal_at: Callable[[float], SignalFunction],
        inputs: tuple[SensorInput, ...],
        *,
        realtime: bool = True,
        tcp: bool = False,
        traits: DataqTraits | None = None,
        faults: DataqFaults | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        super().__init__(tcp)
        self._signal_at, self._inputs = signal_at, {sensor.number: (i, sensor) for i, sensor in enumerate(inputs)}
        self._realtime, self._clock = realtime, clock
        self._traits, self._faults = traits or DataqTraits(), faults or DataqFaults()
        self._info = {0: "DATAQ", 1: self._traits.model, 2: self._traits.firmware, 6: EMULATED_SERIAL, 9: "60000000"}
        self._ranges = protocol.DATAQ_RANGES[self._traits.model]
        self._scan_list = [0]
        self._settings = {"srate": 6000, "dec": 1, "deca": 1, "ps": 0, "encode": 1}
        self._received = b""
        self.streaming = False
        """True if it is scanning."""
        self._may_overflow = True
        if self._faults.streaming_at_connect:
            self._start()

    def serve_once(self) -> bool:
        wait = 0.05
        if self.streaming:
            wait = 0.002 if self._realtime or not self._has_room() else 0.0
        lines, self._received = protocol.split_lines(self._received + self.wire.exchange(wait))
        for line in [] if self._faults.ignores_commands else lines:
            self._execute(line)
        if self.streaming:
            self._stream()
        limit = self._faults.unplug_after
        return limit is None or not self.streaming or self._scan < limit

    def _execute(self, line: str) -> None:
        if self.streaming:
            if line == "stop":
                self.streaming = False
                time.sleep(self._traits.stop_delay)
                if self._traits.echoes_stop:
                    self._reply(line)
            return
        name, *arguments = line.split() or [""]
        if name == "start":
            self._start()
            return
        try:
            self._reply(self._answer(name, arguments, line))
        except (ValueError, LookupError):
            self._reply(INVALID_PARAMETER_REPLY)

    def _answer(self, name: str, arguments: list[str], line: str) -> str:
        """Return the echo with its additions. ValueError or LookupError for invalid arguments."""
        if name == "info":
            return f"{line} {self._info[int(arguments[0])]}"
        if name == "slist":
            self._set_scan_list(*map(int, arguments))
        elif name == "filter":
            if arguments[0] != "*" or not 0 <= int(arguments[1]) <= 3:
                raise ValueError(line)
        elif name in PARAMETER_LIMITS:
            value = int(arguments[0])
            if not PARAMETER_LIMITS[name][0] <= value <= PARAMETER_LIMITS[name][1]:
                raise ValueError(line)
            self._settings[name] = value
        elif name != "stop":
            return UNKNOWN_COMMAND_REPLY
        return line

    def _set_scan_list(self, position: int, code: int) -> None:
        source, gain = code & 0xF, code >> 8
        if source > DIGITAL_INPUTS_CODE or (source < DIGITAL_INPUTS_CODE and gain >= len(self._ranges)):
            raise ValueError(code)
        if position > len(self._scan_list):
            raise ValueError(position)
        self._scan_list[position:] = [code]

    def _reply(self, line: str) -> None:
        self.wire.pending += line.encode() + (b"\r\0" if self._traits.trailing_nul else b"\r")

    def _start(self) -> None:
        setting = protocol.RateSetting(*(self._settings[name] for name in ("srate", "dec", "deca")))
        self._rate = setting.rate(int(self._info[9])) * (0.5 if self._faults.halved_rate else 1.0)
        self._signal = self._signal_at(self._rate * (len(self._scan_list) if self._traits.is_multiplexed else 1))
        self._started, self._scan, self._sent = self._clock(), 0, 0
        self._unsent = b""
        self.streaming = True

    def _stream(self) -> None:
        """Generate the scans that are due and send them in whole packets. Stop if the host is late."""
        if self._faults.stall_after is not None and self._scan >= self._faults.stall_after:
            return
        if self._realtime and not self._has_room():
            self._overflow()
            return
        due = MAX_SCANS_PER_STEP if self._has_room() else 0
        if self._realtime:
            due = min(int((self._clock() - self._started) * self._rate) - self._scan, MAX_SCANS_PER_STEP)
        if due > 0:
            self._unsent += self._scans(due).tobytes()
        size = protocol.packet_bytes(self._settings["ps"])
        while len(self._unsent) >= size:
            self._send(self._unsent[:size])
            self._unsent = self._unsent[size:]
        limit = self._faults.overflow_after
        if limit is not None and self._scan >= limit and self._may_overflow:
            self._may_overflow = False
            self._overflow()

    def _has_room(self) -> bool:
        """Return whether the buffer takes more. Not in real time, little is sent ahead of the host."""
        size = int(DATAQ_BUFFER_SECONDS * self._rate) * 2 * len(self._scan_list) if self._realtime else 1 << 16
        return len(self.wire.pending) <= size

    def _overflow(self) -> None:
        self.wire.pending += protocol.OVERFLOW_REPLY + b"1\r"
        self.streaming = False

    def _send(self, packet: bytes) -> None:
        self._sent += len(packet)
        if self._faults.drop_at is not None:
            start = self._faults.drop_at - self._sent + len(packet)
            packet = packet[: max(start, 0)] + packet[max(start + self._faults.drop_bytes, 0) :]
        self.wire.pending += packet

    def _scans(self, count: int) -> NDArray[np.int16]:
        """Return the next words, shape (count, length of the scan list)."""
        step = len(self._scan_list) if self._traits.is_multiplexed else 1
        values = self._signal(self._scan * step, count * step)
        words = np.zeros((count, len(self._scan_list)), "<i2")
        for position, code in enumerate(self._scan_list):
            number, gain = code & 0xF, code >> 8
            if number == DIGITAL_INPUTS_CODE:
                words[:, position] = self._digital_words(count)
            elif number in self._inputs:
                row, sensor = self._inputs[number]
                bits = self._traits.bits
                channel = replace(sensor.channel, full_scale=self._ranges[gain], adc_bits=bits)
                words[:, position] = channel.encode(values[row, position % step :: step]) << 16 - bits
        self._scan += count
        return words

    def _digital_words(self, count: int) -> NDArray[np.int16]:
        words = np.full(count, self._traits.digital_word, "<i2")
        if self._traits.clock_hz:
            halves = (self._scan + np.arange(count)) * (2 * self._traits.clock_hz / self._rate)
            words[halves.astype(int) % 2 == 1] &= ~CLOCK_BIT
        return words
