"""Commands to a DATAQ device that is not scanning, each with its echo, and who it is."""

from __future__ import annotations

import time
from dataclasses import dataclass

from acquisition.dataq.protocol import REFUSALS, answer_in, encode_command, model_of, split_lines
from acquisition.errors import DeviceError
from acquisition.ports.serial_link import SerialLink
from acquisition.source import DeviceIdentity

ANSWER_TIME = 0.5
"""How long a command may stay without its echo before it is sent again (s)."""
TRIES = 3
"""How often a command is sent."""
QUIET = 0.2
"""A device that sends nothing for so long has stopped (s)."""
DRAIN_TIME = 1.0
"""How long a device may go on sending after a `stop` before it is sent again (s)."""
CDC_HINT = (
    "its LED must blink yellow (CDC mode): "
    "plug it in, press its button while the LED is green, hold it until the LED is red, let go"
)


@dataclass(frozen=True)
class DataqIdentity:
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


class DataqDialogue:
    """Asks and tells over an open link."""

    def __init__(self, link: SerialLink, tries: int = TRIES) -> None:
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
        deadline = time.monotonic() + DRAIN_TIME
        while time.monotonic() < deadline:
            if not self._link.read(QUIET):
                return True
        return False

    def settle(self) -> None:
        """Wait for an echo and for what follows it: nothing that the device sent before is on its way any more."""
        self.ask("info 0")
        self.drain()

    def identify(self) -> DataqIdentity:
        """Who the device is; DeviceError for one that is not of this family."""
        maker, model, firmware, serial, dividend = (self.ask(f"info {i}") for i in (0, 1, 2, 6, 9))
        try:
            if maker.upper() != "DATAQ":
                raise ValueError(f"maker {maker!r} is not DATAQ")
            if not serial:
                raise ValueError("it names no serial number, by which its measured sample rate is known again")
            return DataqIdentity(model_of(model), serial[:8], firmware, int(dividend))
        except ValueError as error:
            raise DeviceError(f"the device on {self._link.port} is none that this driver knows: {error}") from error

    def ask(self, command: str) -> str:
        """Send, and wait for the echo; what the device adds to it."""
        last_line = ""
        for _ in range(self._tries):
            self._link.write(encode_command(command))
            unfinished = b""
            deadline = time.monotonic() + ANSWER_TIME
            while (left := deadline - time.monotonic()) > 0:
                lines, unfinished = split_lines(unfinished + self._link.read(left))
                for line in lines:
                    answer = answer_in(command, line)
                    if answer is not None and not any(refusal in answer for refusal in REFUSALS):
                        return answer
                    last_line = line or last_line
        tries = f"{self._tries} tries"
        if not last_line:
            raise DeviceError(f"no DATAQ device answers on {self._link.port} ({command}, {tries})", CDC_HINT)
        raise DeviceError(
            f"the device on {self._link.port} does not take {command!r} ({tries}); it says {last_line[:60]!r}"
        )
