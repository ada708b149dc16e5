"""Whether a TAPS/1 device answers on an open port."""

from __future__ import annotations

import json
import time
from typing import Any

from acquisition.ports.serial_link import SerialLink
from acquisition.source import DeviceIdentity
from acquisition.taps.protocol import Frame, FrameDecoder, MessageType, encode_frame

ANSWER_TIME = 1.0
"""How long an answer is waited for (s)."""


def probe_taps(link: SerialLink) -> DeviceIdentity | None:
    """Who answers to one HELLO; None where nobody does."""
    decoder = FrameDecoder()
    link.write(b"\x00" + encode_frame(Frame(MessageType.HELLO)))  # ends what another program has left half said
    deadline = time.monotonic() + ANSWER_TIME
    while (left := deadline - time.monotonic()) > 0:
        for frame in decoder.feed(link.read(left)):
            if frame.type == MessageType.INFO:
                return _identity_in(frame.body)
    return None


def identity_in(info: dict[str, Any]) -> DeviceIdentity:
    """Who the device is that sends this INFO."""
    return DeviceIdentity(*(str(info.get(key) or "") for key in ("model", "serial", "fw")))


def _identity_in(body: bytes) -> DeviceIdentity | None:
    try:
        return identity_in(json.loads(body))
    except (ValueError, AttributeError):
        return None
