"""A DATAQ device on its virtual serial port as a source of scans."""

from __future__ import annotations

import enum
import time
from collections import deque
from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import Self

from acquisition.channel import Block, SensorInput
from acquisition.dataq.protocol import (
    DIGITAL_INPUTS_CODE,
    MIN_FIRMWARE_VERSION,
    DataqCommandLink,
    DataqInfo,
    check_inputs,
    choose_packet_code,
    choose_rate,
    encode_command,
    encode_range,
    encode_scan_entry,
    parse_firmware,
)
from acquisition.dataq.stream import CodeBlock, ScanDecoder
from acquisition.errors import DeviceError
from acquisition.ports.serial_ports import SerialLink
from acquisition.source import Event

DATAQ_SILENCE_TIMEOUT = 3.0
"""A scanning device that gives no scans for so long has failed (s)."""
DATAQ_DEFAULT_RATE = 50_000.0
"""Hz, where none is asked for: force and acceleration with the digital word are 150 000 words a second."""


class DataqStatus(enum.StrEnum):
    """What the device is doing."""

    STOPPED = "stopped"
    SCANNING = "scanning"
    OVERFLOW = "overflow"
    """Its buffer ran over and it stopped by itself; scanning has been started again and no scan has come yet."""


class DataqSource:
    """Connects, asks the device who it is, configures it, and yields its scans. A context manager."""

    follows_clock = True
    """Its scans come at the rate that it names."""
    fault = ""
    """It tells of no faults."""

    def __init__(
        self,
        port: str,
        inputs: Sequence[SensorInput],
        sample_rate: float | None = None,
        digital_word: bool = True,
        *,
        digital_clock: bool = False,
    ) -> None:
        """Open a port: a device name or socket://host:port. The rate is the nearest the device has (Hz).

        digital_word scans the digital inputs too, whose word shows when bytes are lost; digital_clock: a square wave
        on digital input 0 shows the loss of whole scans, too. Raises DeviceError where there is no port or no such
        device, ValueError for inputs, ranges and rates it does not have.
        """
        check_inputs(inputs)
        self.channels = tuple(sensor.channel for sensor in inputs)
        """What is on each input."""
        self.loss_detection = "digital word" + " and clock" * digital_clock if digital_word else "none"
        """How lost scans are found."""
        self.events: deque[Event] = deque()
        """It tells of no events."""
        self.status = DataqStatus.STOPPED
        """What it is doing."""
        self.overflows = 0
        """How often its buffer ran over."""
        self._decoder = ScanDecoder(len(inputs), digital_word, digital_clock)
        self._next_scan = self._overruns = 0
        self._has_sent = False
        self._heard = 0.0
        self._link = SerialLink(port)
        self._dialogue = DataqCommandLink(self._link)
        try:
            self._dialogue.halt()
            device = self._identify()
            self.identity = device.identity
            self.sample_rate = self._configure(
                device, inputs, DATAQ_DEFAULT_RATE if sample_rate is None else sample_rate
            )
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

    def start(self) -> None:
        """Begin an endless stream."""
        if self._has_sent:
            self._dialogue.synchronize()
        self._has_sent, self._next_scan = True, 0
        self._heard = time.monotonic()
        self._decoder.begin()
        self._link.write(encode_command("start"))  # no echo: the stream begins
        self.status = DataqStatus.SCANNING

    def stop(self) -> None:
        """End the stream."""
        self.status = DataqStatus.STOPPED
        self._dialogue.halt()

    def close(self) -> None:
        """Stop where the device still answers, then give the port back."""
        self.status = DataqStatus.STOPPED
        try:
            self._link.write(encode_command("stop"))
        except DeviceError:
            pass
        finally:
            self._link.close()

    def blocks(self) -> Iterator[Block]:
        """Blocks with the scans lost before each; DeviceError where the device falls silent or is unplugged.

        Where the device's buffer ran over, or ours because nobody asked for blocks for too long, it is started again;
        the gap is told by the clock.
        """
        since = time.monotonic()
        while self.status != DataqStatus.STOPPED:
            data = self._link.read(0.1)
            if self._link.overruns > self._overruns or (not data and self._decoder.has_overflowed()):
                if self.status == DataqStatus.SCANNING:
                    since = time.monotonic()
                self._start_again()
                continue
            for piece in self._decoder.feed(data):
                self.status = DataqStatus.SCANNING
                yield self._block(piece)
                since = self._heard = time.monotonic()
            if time.monotonic() - since > DATAQ_SILENCE_TIMEOUT:
                raise self._failed(bool(data))

    def _block(self, piece: CodeBlock) -> Block:
        codes, lost = piece
        first = self._next_scan + lost
        self._next_scan = first + codes.shape[1]
        return Block(first, codes, lost_before=lost)

    def _start_again(self) -> None:
        """After an overflow, there or here."""
        self.status = DataqStatus.OVERFLOW
        self.overflows += 1
        self._dialogue.halt()
        self._dialogue.synchronize()
        self._link.write(encode_command("start"))
        self._overruns = self._link.overruns
        self._decoder.begin(lost=max(round((time.monotonic() - self._heard) * self.sample_rate), 1))

    def _failed(self, sends: bool) -> DeviceError:
        if sends:
            return DeviceError(
                f"the digital inputs of the DAQ on {self._link.port} do not hold still: lost bytes cannot be told",
                "leave them unconnected, or set loss_detection = false in [daq]",
            )
        return DeviceError(
            f"the DAQ on {self._link.port} has sent no samples for {DATAQ_SILENCE_TIMEOUT:g} s",
            "switch it off and on and give the same command again",
        )

    def _identify(self) -> DataqInfo:
        identity = self._dialogue.identify()
        version = parse_firmware(identity.firmware)
        if version is not None and version < MIN_FIRMWARE_VERSION:
            raise DeviceError(
                f"the DI-{identity.model} on {self._link.port} has firmware {version:.2f}",
                f"{MIN_FIRMWARE_VERSION} or newer is needed: install it with the maker's upgrade tool",
            )
        return identity

    def _configure(self, device: DataqInfo, inputs: Sequence[SensorInput], wanted: float) -> float:
        """Send the set-up; the rate that results (Hz)."""
        codes = [
            encode_scan_entry(sensor.number, encode_range(device.model, sensor.channel.full_scale)) for sensor in inputs
        ]
        if self.loss_detection != "none":
            codes.append(DIGITAL_INPUTS_CODE)
        setting = choose_rate(wanted, device.dividend)
        rate = setting.rate(device.dividend)
        commands = ["encode 0", *(f"slist {position} {code}" for position, code in enumerate(codes)), "filter * 0"]
        commands += [f"srate {setting.srate}", f"dec {setting.dec}", f"deca {setting.deca}"]
        for command in (*commands, f"ps {choose_packet_code(2 * len(codes) * rate)}"):
            self._dialogue.send_command(command)
        self._dialogue.drain()  # a NUL after the last echo would be taken for the first byte of the stream
        return rate
