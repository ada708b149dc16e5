"""The Blue Pill: its image starts and fits, and does its part on a model of the chip, at a USB host."""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from bluepill_chip import ADC_IRQ, DADDR, FLASH, RAM, TIMER3_ARR, BluePill, UsbHost

from acquisition.taps.protocol import Frame, MessageType, decode_data, decode_frame, encode_frame

CONFIG = b'{"fs":25000,"channels":[0,1],"format":"i16","samples_per_frame":64}'


@pytest.fixture
def image(built: Callable[..., Path], need: Callable[..., None]) -> bytes:
    need("make", "arm-none-eabi-gcc")
    return (built("bluepill") / "taps.bin").read_bytes()


@pytest.fixture
def host(image: bytes) -> UsbHost:
    return UsbHost(BluePill(image))


def frames(received: bytes) -> Iterator[Frame | None]:
    """Yield complete frames; None for a damaged one."""
    *whole, _ = received.split(b"\x00")
    yield from (decode_frame(frame) for frame in whole)


def test_its_image_starts_and_fits(image: bytes) -> None:
    assert len(image) < 64 * 1024
    stack, *handlers = struct.unpack_from(f"<{16 + ADC_IRQ + 1}I", image)
    assert stack == RAM + 20 * 1024
    for exception in (1, 2, 3, 16 + ADC_IRQ):  # reset, NMI, hard fault, the converters
        handler = handlers[exception - 1]
        assert FLASH < handler < FLASH + len(image)
        assert handler & 1  # Thumb


def test_a_host_finds_a_serial_port_with_the_number_of_the_chip(host: UsbHost) -> None:
    read = host.enumerate()
    assert len(read["device"]) == 18
    assert read["device"][8:12] == struct.pack("<2H", 0x0483, 0x5740)
    assert len(read["configuration"]) == 67
    assert read["serial"][2:].decode("utf-16") == "".join(f"{3 - i % 4 + i - i % 4:02X}" for i in range(12))
    assert read["refused"] == b"stall"
    assert host.chip.registers[DADDR] == 0x87


def test_scans_are_as_converted_and_a_missed_one_is_reported(host: UsbHost) -> None:
    host.enumerate()
    host.give(2, encode_frame(Frame(MessageType.HELLO)))
    (info,) = frames(b"".join(host.packets()))
    assert info is not None
    assert b'"model":"Blue Pill"' in info.body
    host.give(
        2, encode_frame(Frame(MessageType.CONFIG, 1, CONFIG)) + encode_frame(Frame(MessageType.START, 2, bytes(8)))
    )
    received = b"".join(host.packets())
    assert host.chip.is_sampling
    assert 72e6 / (host.chip.registers[TIMER3_ARR] + 1) == 25_000
    for scan in range(1500):
        host.chip.convert(scan, 4095 - scan, is_missed=scan == 700)
        host.chip.run(600)
        if scan % 16 == 15:
            received += b"".join(host.packets())
    codes = dict[int, list[int]]()
    for frame in frames(received):
        assert frame is not None  # length, COBS and CRC fit
        if frame.type == MessageType.DATA:
            block = decode_data(frame.body)
            codes |= zip(
                range(block.first_scan, block.first_scan + block.codes.shape[1]), block.codes.T.tolist(), strict=True
            )
    assert all(pair == [scan - 2048, 2047 - scan] for scan, pair in codes.items())
    missing = sorted(set(range(max(codes))) - set(codes))
    assert 700 in missing
    assert len(missing) < 64  # what was in the ring with it
    assert len(codes) > 1200
