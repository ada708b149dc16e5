"""The device's end of TAPS/1: what it answers to its host, whatever its samples come from."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from acquisition.channel import Channel
from acquisition.source import DeviceIdentity
from acquisition.taps.protocol import SAMPLE_BITS, Frame, MessageType


@dataclass(frozen=True)
class Commands:
    """What a device does at the commands of its host; ValueError, LookupError and TypeError refuse one."""

    info: Callable[[], dict[str, Any]]
    """Function that gives the body of INFO."""
    configure: Callable[[dict[str, Any]], None]
    """Function that takes the body of CONFIG."""
    start: Callable[[int], None]
    """Function that begins a session of so many scans, 0 for endless."""
    stop: Callable[[], None]
    """Function that ends it."""

    def answer(self, frame: Frame) -> tuple[MessageType, bytes]:
        """Do what a frame asks for; type and body of the answer."""
        about = frame.seq.to_bytes(4, "little")
        try:
            if frame.type == MessageType.HELLO:
                return MessageType.INFO, json.dumps(self.info()).encode()
            if frame.type == MessageType.CONFIG:
                self.configure(json.loads(frame.body))
            elif frame.type == MessageType.START:
                self.start(int.from_bytes(frame.body, "little"))
            elif frame.type == MessageType.STOP:
                self.stop()
            else:
                raise ValueError(f"unknown command {frame.type:#04x}")
        except (ValueError, LookupError, TypeError) as error:
            return MessageType.NACK, about + b"\x01\x00" + str(error).encode()
        return MessageType.ACK, about + b"\x00\x00"


def info_of(
    identity: DeviceIdentity, channels: Sequence[Channel], rate: float, *, follows_clock: bool
) -> dict[str, Any]:
    """The body of INFO of a device of one sample rate (Hz)."""
    return {
        "proto": 1,
        "model": identity.model,
        "serial": identity.serial,
        "fw": identity.firmware,
        "adc_bits": max(channel.adc_bits for channel in channels),
        "fs_choices": [rate],
        "simultaneous": True,
        "clock_ppm": 0 if follows_clock else None,
        "channels": [
            {
                "i": i,
                "name": channel.quantity,
                "quantity": channel.quantity,
                "sens_V_per_EU": channel.sensitivity,
                "sens_date": channel.calibration_date,
                "sensor_serial": channel.serial_number,
                "direction": channel.direction,
                "fs_V": channel.full_scale,
                "gain": 1.0,
                "coupling": "IEPE",
                "skew_s": channel.skew,
                "delay_s": 0.0,
            }
            for i, channel in enumerate(channels)
        ],
    }


def configured_bits(wish: dict[str, Any], channels: Sequence[Channel], rate: float) -> int:
    """Bits of the samples that a CONFIG asks for; ValueError where it asks for what such a device does not have."""
    if wish["fs"] != rate or wish["channels"] != list(range(len(channels))):
        raise ValueError(f"CONFIG asks for what this device does not have: {wish}")
    return SAMPLE_BITS[wish["format"]]
