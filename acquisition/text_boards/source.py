"""Read scans from a board that prints its samples, and emulate one."""

import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from acquisition.arrays import Codes, Floats
from acquisition.channel import Block, Channel, SensorInput
from acquisition.emulation.emulated_device import EmulatorThread, SignalFunction
from acquisition.errors import DeviceError
from acquisition.ports.serial_ports import SILENCE_TIMEOUT, SerialLink, find_usb_identity
from acquisition.source import EMULATED_SERIAL, ClosedOnExit, DeviceIdentity, Event
from acquisition.text_boards.decoders import (
    EMULATED_LINE,
    UNCLOCKED_LINE,
    LineDecoder,
    OutputFormat,
    ScanCounter,
    SimpleFrameDecoder,
)

BOARD_LISTEN_TIME = 1.0
"""Time to listen for lines (s)."""
EMULATED_LISTEN_TIME = 0.3
"""Time to listen for the line of an emulated board (s). A USB board is not emulated."""
MIN_NUMBER_LINES = 20
"""Consecutive good lines with the same count of numbers that identify a board."""
MAX_NUMBERS_PER_LINE = 5
"""Most numbers in a line: counter, force and three axes of acceleration."""


def probe_text_board(link: SerialLink) -> DeviceIdentity | None:
    """Listen for a board that prints lines of numbers. It has no serial number of its own.

    Parameters
    ----------
    link
        Open serial link.

    Returns
    -------
    DeviceIdentity or None
        Identity with the count of numbers, None if no board prints.
    """
    decoders = {count: LineDecoder((count,)) for count in range(1, MAX_NUMBERS_PER_LINE + 1)}
    lines = dict.fromkeys(decoders, 0)
    deadline = time.monotonic() + BOARD_LISTEN_TIME
    while max(lines.values()) < MIN_NUMBER_LINES and (remaining := deadline - time.monotonic()) > 0:
        received = link.read(remaining)
        for count, decoder in decoders.items():
            for printed in decoder.feed(received):
                lines[count] = len(printed.rows) + (0 if printed.broken_before else lines[count])
    likeliest = max(lines, key=lambda count: lines[count])
    if lines[likeliest] < MIN_NUMBER_LINES:
        return None
    serial = EMULATED_SERIAL if decoders[likeliest].is_emulated else ""
    return DeviceIdentity(f"text-output board with {likeliest} number{'s' * (likeliest > 1)} per line", serial)


class TextBoardSource(ClosedOnExit):
    """Board that prints its samples, as a source of scans. A context manager.

    The board prints by itself and is never written to. Values come in the order of the inputs, with a counter before
    them if there is one number more than inputs. They are volts, or with `adc_bits` codes of a converter from 0 to
    2^adc_bits - 1 whose center is 0 V. Two things cannot be detected: lost whole lines without a counter, and whether
    both sensors were sampled at once.

    Parameters
    ----------
    port
        Serial device name or socket://host:port.
    inputs
        Sensors, their numbers being the columns after the counter.
    sample_rate
        Nominal number of lines per second (Hz).
    printing
        Output format, None for volts in lines.

    Raises
    ------
    ValueError
        The sample rate is missing, or the inputs are no columns.
    DeviceError
        There is no port.
    """

    fault = ""
    """Empty: the board reports no faults."""

    def __init__(
        self, port: str, inputs: Sequence[SensorInput], sample_rate: float | None, printing: OutputFormat | None = None
    ) -> None:
        self.sample_rate = check_text_board(inputs, sample_rate)
        self.events: deque[Event] = deque()
        self.loss_detection = "broken lines"
        self._printing = printing or OutputFormat()
        bits = self._printing.bits
        self.channels: tuple[Channel, ...] = tuple(replace(sensor.channel, adc_bits=bits) for sensor in inputs)
        self._rows = [sensor.number for sensor in inputs]
        self._running = False
        self._link = SerialLink(port, self._printing.baud_rate)
        usb = find_usb_identity(port)
        heard = _listen_for_emulator(self._link) if usb is None and self._printing.frame is None else LineDecoder()
        self.follows_clock = heard.follows_clock
        """True if scans follow the clock: not those of an emulated board that prints as fast as they are read."""
        self.identity = DeviceIdentity("lines", EMULATED_SERIAL if heard.is_emulated else usb[1] if usb else port)

    def start(self) -> None:
        """Count scans from the next whole line on."""
        while self._link.read(0.0):
            pass
        frame, values = self._printing.frame, len(self.channels)
        self._decoder = SimpleFrameDecoder(frame, values) if frame else LineDecoder((values, values + 1))
        self._counter = ScanCounter(values)
        self._running = True

    def stop(self) -> None:
        """Stop listening. The board goes on."""
        self._running = False

    def close(self) -> None:
        self._running = False
        self._link.close()

    def blocks(self) -> Iterator[Block]:
        """Yield blocks as they arrive. DeviceError if the board is unplugged or prints no samples."""
        scan, last_arrival, overruns = 0, time.monotonic(), self._link.overruns
        while self._running:
            pieces = list(self._decoder.feed(self._link.read(0.2)))
            for values, lost_lines in chain.from_iterable(map(self._counter.split_runs, pieces)):
                late, overruns = self._link.overruns - overruns, self._link.overruns
                lost = max(lost_lines, late)
                scan += lost
                yield Block(scan, self._codes(values), lost_before=lost)
                scan, last_arrival = scan + values.shape[1], time.monotonic()
            if time.monotonic() - last_arrival > SILENCE_TIMEOUT:
                text = f"the board on {self._link.port} has printed no samples for {SILENCE_TIMEOUT:g} s"
                raise DeviceError(text, self._silence_remedy())

    def _silence_remedy(self) -> str:
        """Return the remedy for a board whose samples are not found."""
        if self._printing.frame:
            return "Check baud_rate, frame_start, counter and checksum. Add a checksum if values contain frame_start"
        wanted = ",".join(self.channels[self._rows.index(row)].quantity for row in sorted(self._rows))
        return f"Check baud_rate and the program of the board, which must print counter,{wanted} or {wanted}"

    def _codes(self, values: Floats) -> Codes:
        """Return the codes of the converter, one row per channel."""
        rows = values[self._rows]
        if self._printing.frame is None and self._printing.adc_bits is None:
            volts = zip(self.channels, rows, strict=True)
            return np.array([channel.encode(row / channel.sensitivity) for channel, row in volts], np.int32)
        low, high = self.channels[0].rails
        zero = 0 if self._printing.frame else -low
        codes: Codes = np.clip(np.rint(rows) - zero, low, high).astype(np.int32)
        return codes


def _listen_for_emulator(link: SerialLink) -> LineDecoder:
    """Listen for the line by which an emulated board says that it is emulated."""
    decoder, deadline = LineDecoder(), time.monotonic() + EMULATED_LISTEN_TIME
    while not decoder.is_emulated and (remaining := deadline - time.monotonic()) > 0:
        list(decoder.feed(link.read(remaining)))
    return decoder


def check_text_board(inputs: Sequence[SensorInput], sample_rate: float | None) -> float:
    """Check inputs and sample rate of a board.

    Parameters
    ----------
    inputs
        Sensors, their numbers being the columns after the counter.
    sample_rate
        Lines per second (Hz).

    Returns
    -------
    float
        Sample rate (Hz).

    Raises
    ------
    ValueError
        The sample rate is missing, or the inputs are no columns.
    """
    if sample_rate is None:
        raise ValueError('sample_rate_hz is missing for driver = "lines". Give the nominal number of lines per second.')
    if sorted(sensor.number for sensor in inputs) != list(range(len(inputs))):
        given = ", ".join(str(sensor.number) for sensor in inputs)
        raise ValueError(f"input = {given} in [[daq.channel]] must be 0 to {len(inputs) - 1}. Use each number once.")
    return sample_rate


@dataclass(frozen=True)
class TextBoardTraits:
    """Properties and faults of the board."""

    counter_bits: int = 16
    """Bits of the counter, 0 for no counter."""
    drop_every: int = 0
    """Period in scans at which one is lost, 0 for never."""
    garble_every: int = 0
    """Period in scans at which one is printed with a broken byte, 0 for never."""


SCANS_PER_PRINT = 64
"""Scans printed at once."""


class TextBoardEmulator(EmulatorThread):
    """Emulated board that prints from the moment it is plugged in. It reads nothing.

    Parameters
    ----------
    signal
        Function (first_scan, n_scans) that returns values in N and m/s^2, one row per sensor.
    sensitivities
        Sensitivity of each sensor (V per N or m/s^2).
    full_scale
        Full scale of all channels (V).
    sample_rate
        Sample rate (Hz).
    realtime
        Whether it prints by the clock. False prints as fast as the host reads.
    tcp
        Whether it listens on loopback instead of a pseudo-terminal.
    printing
        Output format, None for volts in lines.
    traits
        Properties and faults, None for the defaults.
    """

    def __init__(
        self,
        signal: SignalFunction,
        sensitivities: tuple[float, ...],
        full_scale: float,
        sample_rate: float,
        *,
        realtime: bool = True,
        tcp: bool = False,
        printing: OutputFormat | None = None,
        traits: TextBoardTraits | None = None,
    ) -> None:
        super().__init__(tcp)
        self._signal, self._rate, self._realtime = signal, sample_rate, realtime
        self._printing, self._traits = printing or OutputFormat(), traits or TextBoardTraits()
        self._sensitivities, self._full_scale = np.array(sensitivities)[:, None], full_scale
        self._scan, self._begun = 0, time.monotonic()

    def serve_once(self) -> bool:
        self.wire.exchange(0.002)
        while self._due():
            volts = self._signal(self._scan, SCANS_PER_PRINT) * self._sensitivities
            for k, row in enumerate(np.clip(volts, -self._full_scale, self._full_scale).T):
                self._print(self._scan + k, row)
            if self._printing.frame is None:
                self.wire.pending += (EMULATED_LINE if self._realtime else UNCLOCKED_LINE) + b"\r\n"
            self._scan += SCANS_PER_PRINT
        return True

    def _due(self) -> bool:
        if not self._realtime:
            return len(self.wire.pending) < 1 << 15
        return self._scan + SCANS_PER_PRINT <= (time.monotonic() - self._begun) * self._rate

    def _print(self, number: int, volts: np.ndarray) -> None:
        how = self._traits
        if how.drop_every and number % how.drop_every == how.drop_every - 1:
            return
        text = bytearray(self._frame(number, volts) if self._printing.frame else self._line(number, volts))
        if how.garble_every and number % how.garble_every == how.garble_every - 1:
            text[len(text) // 2] ^= 0x55
        self.wire.pending += text

    def _counter(self, number: int) -> list[int]:
        return [number % 2**self._traits.counter_bits] if self._traits.counter_bits else []

    def _line(self, number: int, volts: np.ndarray) -> bytes:
        bits = self._printing.adc_bits
        if bits is None:
            words = [f"{volt:.7f}" for volt in volts]
        else:
            codes = np.rint(volts / self._full_scale * 2 ** (bits - 1)) + 2 ** (bits - 1)
            words = [str(int(code)) for code in np.clip(codes, 0, 2**bits - 1)]
        return ",".join([*map(str, self._counter(number)), *words]).encode() + b"\r\n"

    def _frame(self, number: int, volts: np.ndarray) -> bytes:
        form = self._printing.frame
        assert form is not None
        codes = np.clip(np.rint(volts / self._full_scale * 2**15), -(2**15), 2**15 - 1).astype("<i2").tobytes()
        payload = (number % 65536).to_bytes(2, "little") * form.counter + codes
        return form.start + payload + bytes([sum(payload) & 0xFF]) * form.checksum
