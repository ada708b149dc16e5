"""Read scans from a DATAQ device on its virtual serial port."""

import enum
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import closing, suppress

from acquisition.channel import Block, SensorInput
from acquisition.dataq import protocol
from acquisition.dataq.protocol import DataqCommandLink
from acquisition.dataq.stream import ScanDecoder
from acquisition.errors import DeviceError
from acquisition.ports.serial_ports import SILENCE_TIMEOUT, SerialLink
from acquisition.source import ClosedOnExit, Event

DATAQ_DEFAULT_RATE = 50_000.0
"""Default sample rate (Hz). Force, acceleration and digital word are 150 000 words a second."""


class DataqStatus(enum.StrEnum):
    """State of the device."""

    STOPPED = "stopped"
    SCANNING = "scanning"
    OVERFLOW = "overflow"
    """Its buffer overflowed and it stopped by itself. Scanning was restarted, no scan has arrived yet."""


class DataqSource(ClosedOnExit):
    """Connection to a DATAQ device as a source of scans. A context manager.

    Parameters
    ----------
    port
        Serial device name or socket://host:port.
    inputs
        Sensors with the numbers of their inputs.
    sample_rate
        Requested sample rate (Hz). The nearest one of the device is used.
    digital_word
        Whether to scan the digital inputs too. Their word shows when bytes are lost.
    digital_clock
        Whether a square wave on digital input 0 shows the loss of whole scans, too.

    Raises
    ------
    DeviceError
        There is no port or no such device.
    ValueError
        The device does not have an input, range or rate.
    """

    follows_clock = True
    """True, as scans follow the clock."""
    fault = ""
    """Empty: the device reports no faults."""

    def __init__(
        self,
        port: str,
        inputs: Sequence[SensorInput],
        sample_rate: float | None = None,
        digital_word: bool = True,
        *,
        digital_clock: bool = False,
    ) -> None:
        protocol.check_inputs(inputs)
        self.channels = tuple(sensor.channel for sensor in inputs)
        """Channel of each input."""
        self.loss_detection = "digital word" + " and clock" * digital_clock if digital_word else "none"
        """Method by which lost scans are detected."""
        self.events: deque[Event] = deque()
        """Empty: the device reports no events."""
        self.status = DataqStatus.STOPPED
        """State of the device."""
        self.overflows = 0
        """Number of overflows of its buffer."""
        self._decoder = ScanDecoder(len(inputs), digital_word, digital_clock)
        self._next_scan = self._overruns = 0
        self._has_sent, self._last_arrival = False, 0.0
        self._link = SerialLink(port)
        self._commands = DataqCommandLink(self._link)
        try:
            self._commands.halt()
            self.identity, dividend = self._commands.identify()
            self._check_firmware()
            wanted = DATAQ_DEFAULT_RATE if sample_rate is None else sample_rate
            self.sample_rate = self._configure(inputs, wanted, dividend)
        except BaseException:
            self._link.close()
            raise

    def start(self) -> None:
        """Start an endless stream."""
        if self._has_sent:
            self._commands.synchronize()
        self._has_sent, self._next_scan = True, 0
        self._last_arrival = time.monotonic()
        self._decoder.begin()
        self._link.write(protocol.encode_command("start"))  # no echo: the stream begins
        self.status = DataqStatus.SCANNING

    def stop(self) -> None:
        """Stop scanning."""
        self.status = DataqStatus.STOPPED
        self._commands.halt()

    def close(self) -> None:
        """Stop the device if it still answers, and close the port."""
        self.status = DataqStatus.STOPPED
        with closing(self._link), suppress(DeviceError):
            self._link.write(protocol.encode_command("stop"))

    def blocks(self) -> Iterator[Block]:
        """Yield blocks with the scans lost before each. DeviceError if the device falls silent or is unplugged.

        After an overflow of the device's buffer, or of ours because the blocks were not read in time, scanning is
        restarted. The clock gives the length of the gap.
        """
        last_progress = time.monotonic()
        while self.status != DataqStatus.STOPPED:
            data = self._link.read(0.1)
            if self._link.overruns > self._overruns or (not data and self._decoder.has_overflowed()):
                if self.status == DataqStatus.SCANNING:
                    last_progress = time.monotonic()
                self._start_again()
                continue
            for codes, lost in self._decoder.feed(data):
                self.status = DataqStatus.SCANNING
                first = self._next_scan + lost
                self._next_scan = first + codes.shape[1]
                yield Block(first, codes, lost_before=lost)
                last_progress = self._last_arrival = time.monotonic()
            if time.monotonic() - last_progress > SILENCE_TIMEOUT:
                raise self._failed(bool(data))

    def _start_again(self) -> None:
        self.status = DataqStatus.OVERFLOW
        self.overflows += 1
        self._commands.halt()
        self._commands.synchronize()
        self._link.write(protocol.encode_command("start"))
        self._overruns = self._link.overruns
        self._decoder.begin(lost=max(round((time.monotonic() - self._last_arrival) * self.sample_rate), 1))

    def _failed(self, sends: bool) -> DeviceError:
        daq = f"the DAQ on {self._link.port}"
        if sends:
            text = f"the digital inputs of {daq} change, so lost bytes cannot be detected"
            return DeviceError(text, "Leave the digital inputs unconnected, or set loss_detection = false in [daq]")
        text = f"{daq} has sent no samples for {SILENCE_TIMEOUT:g} s"
        return DeviceError(text, "Switch the DAQ off and on, then repeat the command")

    def _check_firmware(self) -> None:
        version = protocol.parse_firmware(self.identity.firmware)
        if version is not None and version < protocol.MIN_FIRMWARE_VERSION:
            text = f"firmware {version:.2f} of the {self.identity.model} on {self._link.port} is too old"
            remedy = f"Install version {protocol.MIN_FIRMWARE_VERSION} or newer with the upgrade tool of DATAQ"
            raise DeviceError(text, remedy)

    def _configure(self, inputs: Sequence[SensorInput], wanted: float, dividend: int) -> float:
        """Configure the device and return the resulting sample rate (Hz)."""
        model = self.identity.model.removeprefix("DI-")
        codes = [sensor.number | protocol.encode_range(model, sensor.channel.full_scale) << 8 for sensor in inputs]
        codes += [protocol.DIGITAL_INPUTS_CODE] * (self.loss_detection != "none")
        setting = protocol.choose_rate(wanted, dividend)
        rate = setting.rate(dividend)
        setup = ["encode 0", *(f"slist {position} {code}" for position, code in enumerate(codes)), "filter * 0"]
        setup += [f"{name} {value}" for name, value in setting._asdict().items()]
        for command in (*setup, f"ps {protocol.choose_packet_code(2 * len(codes) * rate)}"):
            self._commands.send_command(command)
        self._commands.drain()  # a NUL after the last echo would be taken for the first byte of the stream
        return rate
