"""DATAQ command protocol: commands, replies, rates, ranges, and identification of a device.

Commands are lower-case ASCII, ended by CR, and come back as an echo while the device is not scanning; what it scans is
a bare stream of little-endian 16-bit words, one an entry of the scan list, without header, counter or checksum.
Source: Data Acquisition Instrument Command Protocol, DATAQ Instruments; docs/devices.md says what is proven.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from acquisition.channel import SensorInput
from acquisition.errors import DeviceError
from acquisition.ports.serial_ports import SerialLink
from acquisition.source import DeviceIdentity

MIN_FIRMWARE_VERSION = 1.35
"""Binary streams of older firmware are not reliable."""
DIGITAL_INPUTS_CODE = 8
"""Code of the digital inputs in the scan list: a word whose low byte is always 0."""
USB_PACKET_BYTES = 64
"""Some drivers lose whole packets of so many bytes."""
OVERFLOW_REPLY = b"stop 0"
"""What the device writes into the stream when its buffer has run over."""
SRATE_LIMITS, DEC_LIMITS, DECA_LIMITS = (375, 65535), (1, 512), (1, 40_000)
"""Least and largest argument of `srate`, `dec` and `deca`."""
REFUSAL_REPLIES = ("Command not found", "Invalid Parameter", "Command not available")
"""Answers of a device that does not take a command."""

DATAQ_RANGES: Mapping[str, tuple[float, ...]] = {
    "1120": (100.0, 50.0, 20.0, 10.0, 5.0, 2.0),
    "2108": (10.0,),
    "2108P": (10.0, 5.0, 2.5),
    "4108": (10.0, 5.0, 2.0, 1.0, 0.5, 0.2),
    "4208": (100.0, 50.0, 20.0, 10.0, 5.0, 2.0),
    "4718B": (5.0,),
}
"""By model: positive end (V) of the bipolar ranges, in the order of their codes."""


@dataclass(frozen=True)
class RateSetting:
    """Arguments of `srate`, `dec` and `deca`; the rate is dividend / (srate dec deca)."""

    srate: int
    """375 to 65535."""
    dec: int
    """1 to 512."""
    deca: int
    """1 to 40 000."""

    def rate(self, dividend: int) -> float:
        """Scans a second (Hz) for the dividend that `info 9` names."""
        return dividend / (self.srate * self.dec * self.deca)


def check_inputs(inputs: Sequence[SensorInput]) -> None:
    """ValueError for inputs that the device does not have, the same one twice, or none."""
    numbers = [sensor.number for sensor in inputs]
    for number in numbers:
        if not 0 <= number < DIGITAL_INPUTS_CODE:
            raise ValueError(f"input={number} is none of 0 to {DIGITAL_INPUTS_CODE - 1}")
    if not numbers or len(set(numbers)) < len(numbers):
        raise ValueError(f"inputs {numbers} of a DATAQ device must be different ones, at least one")


def choose_rate(wanted: float, dividend: int) -> RateSetting:
    """The setting that comes nearest to a rate (Hz), with as little decimation as can be; ValueError out of reach."""
    fastest, slowest = dividend / SRATE_LIMITS[0], dividend / (SRATE_LIMITS[1] * DEC_LIMITS[1] * DECA_LIMITS[1])
    if not slowest <= wanted <= fastest:
        raise ValueError(
            f"sample rate {wanted:g} Hz is not between {slowest:.2g} and {fastest:g} Hz, what this DAQ has"
        )
    dec = min(math.ceil(dividend / wanted / SRATE_LIMITS[1]), DEC_LIMITS[1])
    deca = min(math.ceil(dividend / wanted / SRATE_LIMITS[1] / dec), DECA_LIMITS[1])
    srate = round(dividend / wanted / dec / deca)
    return RateSetting(min(max(srate, SRATE_LIMITS[0]), SRATE_LIMITS[1]), dec, deca)


def choose_packet_code(bytes_per_second: float) -> int:
    """Smallest argument of `ps` (packets of 16 x 2^ps bytes) with at most 100 packets a second, else the largest, 7."""
    return next((n for n in range(8) if bytes_per_second <= 100 * packet_bytes(n)), 7)


def packet_bytes(ps: int) -> int:
    """Bytes of one packet for an argument of `ps`."""
    return 16 << ps


def encode_command(command: str) -> bytes:
    """The bytes of a command."""
    return command.encode("ascii") + b"\r"


def split_lines(received: bytes) -> tuple[list[str], bytes]:
    """Whole lines in what was received, and what is left of the last; NUL and LF count for nothing."""
    *lines, unfinished = received.replace(b"\0", b"").replace(b"\n", b"").split(b"\r")
    return [line.decode("ascii", "replace").strip() for line in lines], unfinished


def parse_answer(command: str, line: str) -> str | None:
    """What a device adds to the echo of a command ("" where nothing); None where the line is no echo of it."""
    sent, words = command.split(), line.split()
    return " ".join(words[len(sent) :]) if words[: len(sent)] == sent else None


def parse_model(answer: str) -> str:
    """Key of RANGES for an answer to `info 1`, e.g. "2108P" for "DI-2108-P"; ValueError for other devices."""
    model = answer.upper().removeprefix("DI").replace("-", "").replace(" ", "")
    if model not in DATAQ_RANGES:
        raise ValueError(f"model {answer!r} is none of {', '.join(f'DI-{number}' for number in DATAQ_RANGES)}")
    return model


def parse_firmware(answer: str) -> float | None:
    """Version in an answer to `info 2`: "1.35", or hundredths in hexadecimal, "87"; None where it is neither."""
    try:
        return float(answer) if "." in answer else int(answer, 16) / 100
    except ValueError:
        return None


def encode_range(model: str, full_scale: float) -> int:
    """Code of a range (V) of a model; ValueError with all it has."""
    if full_scale not in DATAQ_RANGES[model]:
        has = ", ".join(f"{volts:g}" for volts in DATAQ_RANGES[model])
        raise ValueError(f"range_v={full_scale:g} is no range of the DI-{model}; it has +-{has} V")
    return DATAQ_RANGES[model].index(full_scale)


def encode_scan_entry(number: int, code: int) -> int:
    """Entry of the scan list for an analog input at a range."""
    return number | code << 8


DATAQ_ECHO_TIMEOUT = 0.5
"""How long a command may stay without its echo before it is sent again (s)."""
DATAQ_COMMAND_TRIES = 3
"""How often a command is sent."""
DATAQ_STOP_SILENCE = 0.2
"""A device that sends nothing for so long has stopped (s)."""
MAX_DRAIN_TIME = 1.0
"""How long a device may go on sending after a `stop` before it is sent again (s)."""
CDC_HINT = (
    "its LED must blink yellow (CDC mode): "
    "plug it in, press its button while the LED is green, hold it until the LED is red, let go"
)


@dataclass(frozen=True)
class DataqInfo:
    """What `info` says."""

    model: str
    """Model, a key of RANGES, e.g. "4108"."""
    serial: str
    """Serial number."""
    firmware: str
    """Firmware, as the device writes it."""
    dividend: int
    """Dividend of the rate formula (Hz)."""

    @property
    def identity(self) -> DeviceIdentity:
        """The same as of any device."""
        return DeviceIdentity(f"DI-{self.model}", self.serial, self.firmware)


class DataqCommandLink:
    """Asks and tells over an open link."""

    def __init__(self, link: SerialLink, tries: int = DATAQ_COMMAND_TRIES) -> None:
        """tries: how often each command is sent before the device is given up."""
        self._link, self._tries = link, tries

    def halt(self) -> None:
        """Stop scanning and read until nothing more comes; a scanning device does not echo."""
        for _ in range(self._tries):
            self._link.write(encode_command("stop"))
            if self.drain():
                return
        raise DeviceError(
            f"the device on {self._link.port} does not stop sending ({self._tries} tries)",
            "check that this is the DAQ's port, then unplug it and plug it in again",
        )

    def drain(self) -> bool:
        """Read until nothing more comes; whether that was so in time."""
        deadline = time.monotonic() + MAX_DRAIN_TIME
        while time.monotonic() < deadline:
            if not self._link.read(DATAQ_STOP_SILENCE):
                return True
        return False

    def synchronize(self) -> None:
        """Wait for an echo and for what follows it: nothing that the device sent before is on its way any more."""
        self.send_command("info 0")
        self.drain()

    def identify(self) -> DataqInfo:
        """Who the device is; DeviceError for one that is not of this family."""
        maker, model, firmware, serial, dividend = (self.send_command(f"info {i}") for i in (0, 1, 2, 6, 9))
        try:
            if maker.upper() != "DATAQ":
                raise ValueError(f"maker {maker!r} is not DATAQ")
            if not serial:
                raise ValueError("it names no serial number, by which its measured sample rate is known again")
            return DataqInfo(parse_model(model), serial[:8], firmware, int(dividend))
        except ValueError as error:
            raise DeviceError(f"the device on {self._link.port} is none that this driver knows: {error}") from error

    def send_command(self, command: str) -> str:
        """Send, and wait for the echo; what the device adds to it."""
        last_line = ""
        for _ in range(self._tries):
            self._link.write(encode_command(command))
            unfinished = b""
            deadline = time.monotonic() + DATAQ_ECHO_TIMEOUT
            while (left := deadline - time.monotonic()) > 0:
                lines, unfinished = split_lines(unfinished + self._link.read(left))
                for line in lines:
                    answer = parse_answer(command, line)
                    if answer is not None and not any(refusal in answer for refusal in REFUSAL_REPLIES):
                        return answer
                    last_line = line or last_line
        tries = f"{self._tries} tries"
        if not last_line:
            raise DeviceError(f"no DATAQ device answers on {self._link.port} ({command}, {tries})", CDC_HINT)
        raise DeviceError(
            f"the device on {self._link.port} does not take {command!r} ({tries}); it says {last_line[:60]!r}"
        )


def probe_dataq(link: SerialLink) -> DeviceIdentity | None:
    """Who answers, asked once; None where nobody of this family does."""
    dialogue = DataqCommandLink(link, tries=1)
    try:
        dialogue.halt()
        return dialogue.identify().identity
    except DeviceError:
        return None
