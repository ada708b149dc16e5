"""The Raspberry Pi Pico: compiled with either converter, an image that its boot loader takes."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import pytest

FLASH, RP2040 = 0x10000000, 0xE48BFF56


def crc(data: bytes) -> int:
    """CRC-32/MPEG-2 by long division of bits, as the datasheet defines it."""
    bits = int.from_bytes(data, "big") << 32 ^ 0xFFFFFFFF << 8 * len(data)
    for place in range(8 * len(data) + 31, 31, -1):
        if bits >> place & 1:
            bits ^= 0x104C11DB7 << place - 32
    return bits


@pytest.mark.parametrize("converter", [12, 24])
def test_its_image_is_whole(converter: int, built: Callable[..., Path], need: Callable[..., None]) -> None:
    need("make", "arm-none-eabi-gcc")
    image = (built("pico", f"CONVERTER={converter}") / "taps.uf2").read_bytes()
    blocks = [image[at : at + 512] for at in range(0, len(image), 512)]
    binary = b""
    for number, block in enumerate(blocks):
        first, second, _, address, size, index, count, family = struct.unpack_from("<8I", block)
        assert (first, second, block[-4:]) == (0x0A324655, 0x9E5D5157, struct.pack("<I", 0x0AB16F30))
        assert (address, index, count, family) == (FLASH + len(binary), number, len(blocks), RP2040)
        binary += block[32 : 32 + size]
    assert struct.unpack_from("<I", binary, 252)[0] == crc(binary[:252])  # else the boot ROM does not start it
    stack, reset = struct.unpack_from("<2I", binary, 256)
    assert 0x20000000 < stack <= 0x20042000
    assert FLASH < reset < FLASH + len(binary)
    assert reset & 1  # Thumb
