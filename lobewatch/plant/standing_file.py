"""standing.json beside the history: how a machine stands, derived, for those who look at many machines at once."""

from __future__ import annotations

import zlib
from datetime import datetime, timedelta
from functools import cache
from importlib.metadata import version
from pathlib import Path

import msgspec

from acquisition.atomic import atomic_write
from lobewatch.machine.folder_path import mark_of
from lobewatch.plant.summary import Summary

STANDING = "standing.json"
MAKE = 1
"""Of the file; another is made anew."""
KEPT = timedelta(days=7)
"""So long its forecast counts."""
HEAD = len('{"crc":"01234567",')
"""Bytes of the file before the others; the checksum is that of these as an object of their own."""


class _File(msgspec.Struct, frozen=True):
    make: int
    software: str
    mark: tuple[int, ...]
    made: str
    summary: Summary


_encode, _decode = msgspec.json.Encoder().encode, msgspec.json.Decoder(_File).decode


def read_standing(folder: Path, now: datetime) -> Summary | None:
    """What stands beside a machine, where it fits its files; None for none, torn, altered, old, of another version,
    or of another folder."""
    try:
        content = (folder / STANDING).read_bytes()
        body = b"{" + content[HEAD:]
        if content[:HEAD] != _head(body):
            return None
        found = _decode(body)
        age = now - datetime.fromisoformat(found.made)
    except (OSError, ValueError, TypeError):
        return None
    if (found.make, found.software, found.mark) != (MAKE, software(), mark_of(folder, found.summary.newest_file)):
        return None
    named = found.summary.path
    if not timedelta(0) <= age < KEPT or (named != str(folder) and found.summary.speaks_of(named)):
        return None
    return found.summary


def write_standing(folder: Path, summary: Summary, mark: tuple[int, ...], now: datetime) -> None:
    """Keep it beside the machine, whole or not at all; mark: of the files it was made of. To be called under the lock.

    OSError where it cannot be written.
    """
    body = _encode(_File(MAKE, software(), mark, now.isoformat(), summary))
    atomic_write(folder / STANDING, _head(body) + body[1:], lasting=False)


def _head(body: bytes) -> bytes:
    """The checksum as the first field."""
    return b'{"crc":"%08x",' % zlib.crc32(body)


@cache
def software() -> str:
    """Version of this program."""
    return version("lobewatch")
