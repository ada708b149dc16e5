"""Command protocol of DATAQ DI-1120, 2108, 2108-P, 4108, 4208 and 4718B on a virtual serial port.

Commands are lower-case ASCII ending with CR. The device echoes them while it is not scanning. Scans are a bare stream
of little-endian 16-bit words, one per entry of the scan list, without header, counter or checksum.
Source: Data Acquisition Instrument Command Protocol, DATAQ Instruments. docs/devices.md says what is proven.
"""

import math
import time
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from acquisition.channel import SensorInput
from acquisition.errors import DeviceError
from acquisition.ports.serial_ports import SerialLink
from acquisition.source import DeviceIdentity

MIN_FIRMWARE_VERSION = 1.35
"""Oldest firmware with reliable binary streams."""
DIGITAL_INPUTS_CODE = 8
"""Scan list code of the digital inputs, a word whose low byte is always 0."""
USB_PACKET_BYTES = 64
"""Size of a USB packet (bytes). Some drivers lose whole packets."""
OVERFLOW_REPLY = b"stop 0"
"""Text that the device writes into the stream when its buffer overflows."""
SRATE_LIMITS, DEC_LIMITS, DECA_LIMITS = (375, 65535), (1, 512), (1, 40_000)
"""Smallest and largest argument of `srate`, `dec` and `deca`."""
REFUSAL_REPLIES = ("Command not found", "Invalid Parameter", "Command not available")
"""Answers of a device that rejects a command."""

DATAQ_RANGES: Mapping[str, tuple[float, ...]] = {
    "1120": (100.0, 50.0, 20.0, 10.0, 5.0, 2.0),
    "2108": (10.0,),
    "2108P": (10.0, 5.0, 2.5),
    "4108": (10.0, 5.0, 2.0, 1.0, 0.5, 0.2),
    "4208": (100.0, 50.0, 20.0, 10.0, 5.0, 2.0),
    "4718B": (5.0,),
}
"""Positive end (V) of the bipolar ranges by model, in the order of their codes."""


class RateSetting(NamedTuple):
    """Arguments of `srate`, `dec` and `deca`. The rate is dividend / (srate dec deca)."""

    srate: int
    """Sample rate divisor, 375 to 65535."""
    dec: int
    """First decimation factor, 1 to 512."""
    deca: int
    """Second decimation factor, 1 to 40 000."""

    def rate(self, dividend: int) -> float:
        """Return the sample rate (Hz) for the dividend that `info 9` reports."""
        return dividend / (self.srate * self.dec * self.deca)


def check_inputs(inputs: Sequence[SensorInput]) -> None:
    """Check the inputs of a DATAQ device.

    Parameters
    ----------
    inputs
        Sensors with the numbers of their inputs.

    Raises
    ------
    ValueError
        An input does not exist or is used twice, or there is none.
    """
    numbers = [sensor.number for sensor in inputs]
    for number in numbers:
        if not 0 <= number < DIGITAL_INPUTS_CODE:
            raise ValueError(f"input={number} of a DATAQ device is not one of 0 to {DIGITAL_INPUTS_CODE - 1}")
    if not numbers or len(set(numbers)) < len(numbers):
        raise ValueError(f"inputs {numbers} of a DATAQ device are invalid. Give one or more inputs, each once.")


def choose_rate(wanted: float, dividend: int) -> RateSetting:
    """Return the setting nearest to a rate (Hz) with the least decimation. ValueError if it is out of reach."""
    fastest, slowest = dividend / SRATE_LIMITS[0], dividend / (SRATE_LIMITS[1] * DEC_LIMITS[1] * DECA_LIMITS[1])
    if not slowest <= wanted <= fastest:
        raise ValueError(f"sample rate {wanted:g} Hz is outside the range {slowest:.2g} to {fastest:g} Hz of this DAQ")
    dec = min(math.ceil(dividend / wanted / SRATE_LIMITS[1]), DEC_LIMITS[1])
    deca = min(math.ceil(dividend / wanted / SRATE_LIMITS[1] / dec), DECA_LIMITS[1])
    srate = round(dividend / wanted / dec / deca)
    return RateSetting(min(max(srate, SRATE_LIMITS[0]), SRATE_LIMITS[1]), dec, deca)


def choose_packet_code(bytes_per_second: float) -> int:
    """Return the smallest `ps` argument (packets of 16 x 2^ps bytes) for at most 100 packets a second, else 7."""
    return next((n for n in range(8) if bytes_per_second <= 100 * packet_bytes(n)), 7)


def packet_bytes(ps: int) -> int:
    """Return the packet size for a `ps` argument (bytes)."""
    return 16 << ps


def encode_command(command: str) -> bytes:
    return command.encode("ascii") + b"\r"


def split_lines(received: bytes) -> tuple[list[str], bytes]:
    """Split received bytes into whole lines and the unfinished rest. NUL and LF are ignored."""
    *lines, unfinished = received.replace(b"\0", b"").replace(b"\n", b"").split(b"\r")
    return [line.decode("ascii", "replace").strip() for line in lines], unfinished


def parse_answer(command: str, line: str) -> str | None:
    """Return what a device adds to the echo of a command. None if the line is not its echo."""
    sent, words = command.split(), line.split()
    return " ".join(words[len(sent) :]) if words[: len(sent)] == sent else None


def parse_model(answer: str) -> str:
    """Return the key of DATAQ_RANGES for an answer to `info 1`, e.g. "2108P" for "DI-2108-P".

    ValueError for other devices.
    """
    model = answer.upper().removeprefix("DI").replace("-", "").replace(" ", "")
    if model not in DATAQ_RANGES:
        raise ValueError(f"model {answer!r} is not one of {', '.join(f'DI-{number}' for number in DATAQ_RANGES)}")
    return model


def parse_firmware(answer: str) -> float | None:
    """Return the version in an answer to `info 2`: "1.35", or hundredths in hexadecimal, "87". None if invalid."""
    try:
        return float(answer) if "." in answer else int(answer, 16) / 100
    except ValueError:
        return None


def encode_range(model: str, full_scale: float) -> int:
    """Return the code of a range (V) of a model. ValueError lists the ranges it has."""
    if full_scale not in DATAQ_RANGES[model]:
        has = ", ".join(f"{volts:g}" for volts in DATAQ_RANGES[model])
        raise ValueError(f"range_v={full_scale:g} is not supported. The ranges of the DI-{model} are ±{has} V.")
    return DATAQ_RANGES[model].index(full_scale)


DATAQ_ECHO_TIMEOUT = 0.5
"""Time after which a command without an echo is sent again (s)."""
DATAQ_COMMAND_TRIES = 3
"""Number of times a command is sent."""
DATAQ_STOP_SILENCE = 0.2
"""Silence that shows that a device has stopped (s)."""
MAX_DRAIN_TIME = 1.0
"""Time that a device may go on sending before `stop` is sent again (s)."""
CDC_HINT = (
    "Set the DATAQ device to CDC mode: plug it in, press its button while the LED is green, release it when red. "
    "The LED then blinks yellow"
)


class DataqCommandLink:
    """Commands to a DATAQ device that is not scanning, each with its echo.

    Parameters
    ----------
    link
        Open serial link.
    tries
        Number of times each command is sent before the device is given up.
    """

    def __init__(self, link: SerialLink, tries: int = DATAQ_COMMAND_TRIES) -> None:
        self._link, self._tries = link, tries

    def halt(self) -> None:
        """Stop scanning and read until nothing more arrives. A scanning device does not echo."""
        for _ in range(self._tries):
            self._link.write(encode_command("stop"))
            if self.drain():
                return
        text = f"the device on {self._link.port} does not stop sending ({self._tries} tries)"
        raise DeviceError(text, "Check that this is the port of the DAQ, then unplug the DAQ and plug it in again")

    def drain(self) -> bool:
        """Read until nothing more arrives. Return whether that happened in time."""
        deadline = time.monotonic() + MAX_DRAIN_TIME
        while time.monotonic() < deadline:
            if not self._link.read(DATAQ_STOP_SILENCE):
                return True
        return False

    def synchronize(self) -> None:
        """Wait for an echo and what follows it, so that nothing sent earlier is still on its way."""
        self.send_command("info 0")
        self.drain()

    def identify(self) -> tuple[DeviceIdentity, int]:
        """Return the identity of the device and its rate dividend. DeviceError if it is not of this family."""
        maker, model, firmware, serial, dividend = (self.send_command(f"info {i}") for i in (0, 1, 2, 6, 9))
        try:
            if maker.upper() != "DATAQ":
                raise ValueError(f"maker {maker!r} is not DATAQ")
            if not serial:
                raise ValueError("no serial number")
            return DeviceIdentity(f"DI-{parse_model(model)}", serial[:8], firmware), int(dividend)
        except ValueError as error:
            raise DeviceError(f"the device on {self._link.port} is not supported by this driver ({error})") from error

    def send_command(self, command: str) -> str:
        """Send a command, wait for its echo, and return what the device adds to it.

        Parameters
        ----------
        command
            Command without its CR.
        """
        last_line = ""
        for _ in range(self._tries):
            self._link.write(encode_command(command))
            unfinished = b""
            deadline = time.monotonic() + DATAQ_ECHO_TIMEOUT
            while (remaining := deadline - time.monotonic()) > 0:
                lines, unfinished = split_lines(unfinished + self._link.read(remaining))
                for line in lines:
                    answer = parse_answer(command, line)
                    if answer is not None and not any(refusal in answer for refusal in REFUSAL_REPLIES):
                        return answer
                    last_line = line or last_line
        port, tries = self._link.port, f"{self._tries} tries"
        if not last_line:
            raise DeviceError(f"no DATAQ device answers on {port} ({command}, {tries})", CDC_HINT)
        raise DeviceError(f"the device on {port} rejects {command!r} with {last_line[:60]!r} ({tries})")


def probe_dataq(link: SerialLink) -> DeviceIdentity | None:
    """Ask once which DATAQ device answers.

    Parameters
    ----------
    link
        Open serial link.

    Returns
    -------
    DeviceIdentity or None
        Identity of the device, None if no DATAQ device answers.
    """
    commands = DataqCommandLink(link, tries=1)
    try:
        commands.halt()
        return commands.identify()[0]
    except DeviceError:
        return None
