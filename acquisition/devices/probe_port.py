"""Which of the devices that lobewatch knows answers on a port."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass

from acquisition.dataq.dialogue import DataqDialogue
from acquisition.dataq.protocol import VENDOR
from acquisition.errors import DeviceError
from acquisition.ports.serial_link import SerialLink
from acquisition.taps.protocol import Frame, FrameDecoder, MessageType, encode_frame

ANSWER_TIME = 1.0
"""How long an answer is waited for (s)."""


@dataclass(frozen=True)
class DeviceIdentity:
    """Who answers."""

    driver: str
    """As in [daq] of machine.toml: "taps" or "dataq"."""
    model: str
    """Model as the device names it."""
    serial: str
    """Serial number."""
    firmware: str
    """Version."""


def probe_port(port: str, vendor: int | None = None) -> DeviceIdentity | None:
    """Who answers on a port; None where nobody known does. DeviceError where it cannot be opened.

    Strange devices are spared: each question is put once, and only that which the USB vendor suggests; a port without
    one (vendor None: a pseudo-terminal, socket://) gets both.
    """
    link = SerialLink(port)
    try:
        found = _ask_taps(link) if vendor != VENDOR else None
        return found or (_ask_dataq(link) if vendor in (VENDOR, None) else None)
    except DeviceError:
        return None
    finally:
        link.close()


def _ask_taps(link: SerialLink) -> DeviceIdentity | None:
    decoder = FrameDecoder()
    link.write(b"\x00" + encode_frame(Frame(MessageType.HELLO)))  # ends what another program has left half said
    deadline = time.monotonic() + ANSWER_TIME
    while (left := deadline - time.monotonic()) > 0:
        for frame in decoder.feed(link.read(left)):
            if frame.type == MessageType.INFO:
                return _taps_identity(frame.body)
    return None


def _taps_identity(body: bytes) -> DeviceIdentity | None:
    try:
        info = json.loads(body)
        return DeviceIdentity("taps", *(str(info.get(key, "")) for key in ("model", "serial", "fw")))
    except (ValueError, AttributeError):
        return None


def _ask_dataq(link: SerialLink) -> DeviceIdentity | None:
    dialogue = DataqDialogue(link, tries=1)
    dialogue.halt()
    found = dialogue.identify()
    return DeviceIdentity("dataq", f"DI-{found.model}", found.serial, found.firmware)
