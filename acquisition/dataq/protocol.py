"""Facts of the protocol of the DATAQ DI-1120, 2108, 2108-P, 4108, 4208 and 4718B over their virtual serial port.

Commands are lower-case ASCII, ended by CR, and come back as an echo while the device is not scanning; what it scans is
a bare stream of little-endian 16-bit words, one an entry of the scan list, without header, counter or checksum.
Source: Data Acquisition Instrument Command Protocol, DATAQ Instruments; docs/devices.md says what is proven.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from acquisition.channel import SensorInput

OLDEST_FIRMWARE = 1.35
"""Binary streams of older firmware are not reliable."""
DIGITAL_INPUTS = 8
"""Code of the digital inputs in the scan list: a word whose low byte is always 0."""
USB_PACKET = 64
"""Some drivers lose whole packets of so many bytes."""
OVERFLOW = b"stop 0"
"""What the device writes into the stream when its buffer has run over."""
SRATE, DEC, DECA = (375, 65535), (1, 512), (1, 40_000)
"""Least and largest argument of `srate`, `dec` and `deca`."""
REFUSALS = ("Command not found", "Invalid Parameter", "Command not available")
"""Answers of a device that does not take a command."""

RANGES: Mapping[str, tuple[float, ...]] = {
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
        if not 0 <= number < DIGITAL_INPUTS:
            raise ValueError(f"input={number} is none of 0 to {DIGITAL_INPUTS - 1}")
    if not numbers or len(set(numbers)) < len(numbers):
        raise ValueError(f"inputs {numbers} of a DATAQ device must be different ones, at least one")


def choose_rate(wanted: float, dividend: int) -> RateSetting:
    """The setting that comes nearest to a rate (Hz), with as little decimation as can be; ValueError out of reach."""
    fastest, slowest = dividend / SRATE[0], dividend / (SRATE[1] * DEC[1] * DECA[1])
    if not slowest <= wanted <= fastest:
        raise ValueError(
            f"sample rate {wanted:g} Hz is not between {slowest:.2g} and {fastest:g} Hz, what this DAQ has"
        )
    dec = min(math.ceil(dividend / wanted / SRATE[1]), DEC[1])
    deca = min(math.ceil(dividend / wanted / SRATE[1] / dec), DECA[1])
    srate = round(dividend / wanted / dec / deca)
    return RateSetting(min(max(srate, SRATE[0]), SRATE[1]), dec, deca)


def choose_packet(bytes_per_second: float) -> int:
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


def answer_in(command: str, line: str) -> str | None:
    """What a device adds to the echo of a command ("" where nothing); None where the line is no echo of it."""
    sent, words = command.split(), line.split()
    return " ".join(words[len(sent) :]) if words[: len(sent)] == sent else None


def model_of(answer: str) -> str:
    """Key of RANGES for an answer to `info 1`, e.g. "2108P" for "DI-2108-P"; ValueError for other devices."""
    model = answer.upper().removeprefix("DI").replace("-", "").replace(" ", "")
    if model not in RANGES:
        raise ValueError(f"model {answer!r} is none of {', '.join(f'DI-{number}' for number in RANGES)}")
    return model


def firmware_of(answer: str) -> float | None:
    """Version in an answer to `info 2`: "1.35", or hundredths in hexadecimal, "87"; None where it is neither."""
    try:
        return float(answer) if "." in answer else int(answer, 16) / 100
    except ValueError:
        return None


def range_code(model: str, full_scale: float) -> int:
    """Code of a range (V) of a model; ValueError with all it has."""
    if full_scale not in RANGES[model]:
        has = ", ".join(f"{volts:g}" for volts in RANGES[model])
        raise ValueError(f"range_v={full_scale:g} is no range of the DI-{model}; it has +-{has} V")
    return RANGES[model].index(full_scale)


def scan_code(number: int, code: int) -> int:
    """Entry of the scan list for an analog input at a range."""
    return number | code << 8
