"""A UF2 image of a binary for the RP2040, with the checksum of its second stage: `image.py IN.bin OUT.uf2`.

UF2: https://github.com/microsoft/uf2. Checksum: RP2040 datasheet, 2.8.1.3.1 (CRC-32 of MPEG-2).
"""

from __future__ import annotations

import struct
import sys
from pathlib import Path

ADDRESS, FAMILY, PAYLOAD, STAGE = 0x10000000, 0xE48BFF56, 256, 252


def checksum(data: bytes) -> int:
    """CRC-32, highest bit first, begun with ones, not inverted."""
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte << 24
        for _ in range(8):
            crc = (crc << 1 ^ (0x04C11DB7 if crc >> 31 else 0)) & 0xFFFFFFFF
    return crc


def main(source: Path, target: Path) -> None:
    """Write the image."""
    binary = source.read_bytes()
    binary = binary[:STAGE] + struct.pack("<I", checksum(binary[:STAGE])) + binary[STAGE + 4 :]
    parts = [binary[at : at + PAYLOAD].ljust(PAYLOAD, b"\0") for at in range(0, len(binary), PAYLOAD)]
    with target.open("wb") as file:
        for i, part in enumerate(parts):
            place = (0x2000, ADDRESS + i * PAYLOAD, PAYLOAD, i, len(parts), FAMILY)
            head = struct.pack("<8I", 0x0A324655, 0x9E5D5157, *place)
            file.write(head + part.ljust(476, b"\0") + struct.pack("<I", 0x0AB16F30))


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
