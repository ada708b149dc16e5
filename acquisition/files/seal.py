"""A checksum behind the last byte of a file, where HDF5 does not look: damage is found before HDF5 sees the bytes."""

from __future__ import annotations

import hashlib

MARK = b"\nlobewatch sha256 "
"""How a seal begins; a file that does not end with one has none."""
SIZE = len(MARK) + 64 + 1


def sealed(content: bytes) -> bytes:
    """The content and its SHA-256."""
    return content + _seal(content)


def is_broken(content: bytes) -> bool:
    """Whether a file has a seal that does not fit the rest of it: one flipped bit can make HDF5 hang or crash."""
    seal = content[-SIZE:]
    return seal.startswith(MARK) and seal != _seal(content[:-SIZE])


def is_sealed(content: bytes) -> bool:
    """Whether a file has a seal that fits the rest of it."""
    return content[-SIZE:] == _seal(content[:-SIZE])


def _seal(content: bytes) -> bytes:
    return MARK + hashlib.sha256(content).hexdigest().encode() + b"\n"
