"""A DATAQ DI-x108 device on its virtual serial port as a source of scans."""

from __future__ import annotations

import enum
import time
from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import Any, Self

from acquisition.channel import Block
from acquisition.dataq import (
    DIGITAL_INPUTS,
    OLDEST_FIRMWARE,
    DataqInput,
    answer_in,
    choose_packet,
    choose_rate,
    encode_command,
    firmware_of,
    model_of,
    range_code,
    scan_code,
    split_lines,
)
from acquisition.dataq_stream import Piece, ScanDecoder
from acquisition.errors import DeviceError
from acquisition.serial_link import SerialLink

ANSWER_TIME = 0.5
"""How long a command may stay without its echo before it is sent again (s)."""
TRIES = 3
"""How often a command is sent."""
QUIET = 0.2
"""A device that sends nothing for so long has stopped (s)."""
SILENCE = 3.0
"""A scanning device that gives no scans for so long has failed (s)."""
DEFAULT_RATE = 50_000.0
"""Hz, where none is asked for: force and acceleration with the digital word are 150 000 words a second."""
CDC_HINT = (
    "its LED must blink yellow (CDC mode): "
    "plug it in, press its button while the LED is green, hold it until the LED is red, let go"
)


class DataqStatus(enum.StrEnum):
    """What the device is doing."""

    STOPPED = "stopped"
    SCANNING = "scanning"
    OVERFLOW = "overflow"
    """Its buffer ran over and it stopped by itself; scanning has been started again and no scan has come yet."""


class DataqSource:
    """Connects, asks the device who it is, configures it, and yields its scans. A context manager."""

    def __init__(
        self, port: str, inputs: Sequence[DataqInput], sample_rate: float | None = None, digital_word: bool = True
    ) -> None:
        """Open a port: a device name or socket://host:port. The rate is the nearest the device has (Hz).

        digital_word scans the digital inputs too, whose word shows when bytes are lost. Raises DeviceError where there
        is no port or no such device, ValueError for inputs, ranges and rates it does not have.
        """
        numbers = [one.number for one in inputs]
        if not numbers or len(set(numbers)) < len(numbers):
            raise ValueError(f"inputs {numbers} of a DATAQ device must be different ones, at least one")
        self.channels = tuple(one.channel for one in inputs)
        self.loss_detection = "digital word" if digital_word else "none"
        self.status = DataqStatus.STOPPED
        self.overflows = 0
        self._decoder = ScanDecoder(len(inputs), digital_word)
        self._next_scan = 0
        self._link = SerialLink(port)
        try:
            self._halt()
            self.info = self._identify()
            self.sample_rate = self._configure(inputs, sample_rate or DEFAULT_RATE)
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
        self._next_scan = 0
        self._decoder.begin()
        self._link.write(encode_command("start"))  # no echo: the stream begins
        self.status = DataqStatus.SCANNING

    def stop(self) -> None:
        """End the stream."""
        self.status = DataqStatus.STOPPED
        self._halt()

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

        A device whose buffer ran over is started again; the gap is told by the clock.
        """
        heard = time.monotonic()
        while self.status != DataqStatus.STOPPED:
            data = self._link.read(0.1)
            for piece in self._decoder.feed(data):
                self.status = DataqStatus.SCANNING
                yield self._block(piece)
                heard = time.monotonic()
            if not data and self._decoder.ran_over():
                self._start_again(heard)
            if time.monotonic() - heard > SILENCE:
                raise self._failed(bool(data))

    def _block(self, piece: Piece) -> Block:
        codes, lost = piece
        first = self._next_scan + lost
        self._next_scan = first + codes.shape[1]
        return Block(first, codes, lost_before=lost)

    def _start_again(self, heard: float) -> None:
        """After an overflow; heard is the time of the last scan."""
        self.status = DataqStatus.OVERFLOW
        self.overflows += 1
        self._halt()
        self._link.write(encode_command("start"))
        self._decoder.begin(lost=max(round((time.monotonic() - heard) * self.sample_rate), 1))

    def _failed(self, sends: bool) -> DeviceError:
        if sends:
            return DeviceError(
                f"the digital inputs of the DAQ on {self._link.port} do not hold still, so that lost bytes cannot be "
                "told: leave them unconnected, or set loss_detection = false in [daq]"
            )
        return DeviceError(
            f"the DAQ on {self._link.port} has sent no samples for {SILENCE:g} s; "
            "switch it off and on and give the same command again"
        )

    def _halt(self) -> None:
        """Stop scanning and read until nothing more comes; a scanning device does not echo."""
        for _ in range(TRIES):
            self._link.write(encode_command("stop"))
            deadline = time.monotonic() + 5 * QUIET
            while time.monotonic() < deadline:
                if not self._link.read(QUIET):
                    return
        raise DeviceError(
            f"the device on {self._link.port} does not stop sending ({TRIES} tries); "
            "check that this is the DAQ's port, then unplug it and plug it in again"
        )

    def _identify(self) -> dict[str, Any]:
        """Model, serial number, firmware and dividend of the rate formula."""
        maker, model, firmware, serial, dividend = (self._command(f"info {i}") for i in (0, 1, 2, 6, 9))
        try:
            if maker.upper() != "DATAQ":
                raise ValueError(f"maker {maker!r} is not DATAQ")
            info = {"model": f"DI-{model_of(model)}", "serial": serial[:8], "fw": firmware, "dividend": int(dividend)}
        except ValueError as error:
            raise DeviceError(f"the device on {self._link.port} is none that this driver knows: {error}") from error
        version = firmware_of(firmware)
        if version is not None and version < OLDEST_FIRMWARE:
            raise DeviceError(
                f"the {info['model']} on {self._link.port} has firmware {version:.2f}; "
                f"{OLDEST_FIRMWARE} or newer is needed: install it with the maker's upgrade tool"
            )
        return info

    def _configure(self, inputs: Sequence[DataqInput], wanted: float) -> float:
        """Send the set-up; the rate that results (Hz)."""
        model, dividend = self.info["model"].removeprefix("DI-"), self.info["dividend"]
        codes = [scan_code(one.number, range_code(model, one.channel.full_scale)) for one in inputs]
        if self.loss_detection != "none":
            codes.append(DIGITAL_INPUTS)
        setting = choose_rate(wanted, dividend)
        rate = setting.rate(dividend)
        commands = ["encode 0", *(f"slist {position} {code}" for position, code in enumerate(codes)), "filter * 0"]
        commands += [f"srate {setting.srate}", f"dec {setting.dec}", f"deca {setting.deca}"]
        for command in (*commands, f"ps {choose_packet(2 * len(codes) * rate)}"):
            self._command(command)
        return rate

    def _command(self, command: str) -> str:
        """Send, and wait for the echo; what the device adds to it."""
        said = ""
        for _ in range(TRIES):
            self._link.write(encode_command(command))
            rest = b""
            deadline = time.monotonic() + ANSWER_TIME
            while (left := deadline - time.monotonic()) > 0:
                lines, rest = split_lines(rest + self._link.read(left))
                for line in lines:
                    if (answer := answer_in(command, line)) is not None:
                        return answer
                    said = line or said
        if not said:
            raise DeviceError(f"no DATAQ device answers on {self._link.port} ({command}, {TRIES} tries); {CDC_HINT}")
        raise DeviceError(
            f"the device on {self._link.port} does not take {command!r} ({TRIES} tries); it says {said[:60]!r}"
        )
