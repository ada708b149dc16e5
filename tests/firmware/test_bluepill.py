"""The Blue Pill: compiled, with vectors that its chip starts from."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

FLASH, RAM, ADC = 0x08000000, 0x20000000, 18


def test_its_image_starts_and_fits(built: Callable[..., Path], need: Callable[..., None]) -> None:
    need("make", "arm-none-eabi-gcc")
    image = (built("bluepill") / "taps.bin").read_bytes()
    assert len(image) < 64 * 1024
    stack, *handlers = struct.unpack_from(f"<{16 + ADC + 1}I", image)
    assert stack == RAM + 20 * 1024
    for exception in (1, 2, 3, 16 + ADC):  # reset, NMI, hard fault, the converters
        handler = handlers[exception - 1]
        assert FLASH < handler < FLASH + len(image)
        assert handler & 1  # Thumb
    assert b'"model":"Blue Pill"' in image
