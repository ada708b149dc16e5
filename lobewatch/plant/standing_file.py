"""standing.json beside the history: how a machine stands, derived, for those who look at many machines at once."""

from __future__ import annotations

import zlib
from datetime import datetime, timedelta
from functools import cache
from importlib.metadata import version
from pathlib import Path

import msgspec

from acquisition.atomic import atomic_write
from acquisition.regular_file import SMALL, read_regular
from lobewatch.machine.folder_path import mark_of
from lobewatch.plant.summary import Summary

STANDING = "standing.json"
MAKE = 3
"""Number of this form of the file; a file of another is made anew."""
LASTING = timedelta(days=7)
"""Time that a summary and its forecast count; chosen."""
HEAD = len('{"crc":"01234567",')
"""Bytes of the head of the file; the checksum in it is that of the others as an object of their own."""


class _StandingFile(msgspec.Struct, frozen=True):
    """The content of the file behind its checksum."""

    make: int
    """Number of its form."""
    software: str
    """Version of the program that made it."""
    mark: tuple[int, ...]
    """Mark of the files that it was made of."""
    made: datetime
    """Time of its making."""
    summary: Summary
    """Summary of the machine."""


_encode, _decode = msgspec.json.Encoder().encode, msgspec.json.Decoder(_StandingFile).decode


def read_standing(folder: Path, now: datetime) -> Summary | None:
    """The summary beside a machine, where it fits its files; None for none, torn, altered, old, of another version,
    or of another folder."""
    return fitting_summary(folder, _content(folder), now)


def read_kept(folder: Path) -> Summary | None:
    """The summary beside a machine as it was kept last, whatever has become of its files; None for none and torn."""
    file = _decoded(_content(folder))
    return None if file is None else file.summary


def fitting_summary(folder: Path, content: bytes, now: datetime) -> Summary | None:
    """The summary in the content of such a file, as `read_standing` gives it."""
    file = _decoded(content)
    if file is None or (file.software, file.mark) != (software(), mark_of(folder, file.summary.newest_file)):
        return None
    age, named = now - file.made, file.summary.path
    if not timedelta(0) <= age < LASTING or (named != str(folder) and file.summary.speaks_of(named)):
        return None
    return file.summary


def standing_content(summary: Summary, mark: tuple[int, ...], now: datetime) -> bytes:
    """Content of the file; mark: of the files that the summary was made of."""
    body = _encode(_StandingFile(MAKE, software(), mark, now, summary))
    return _head(body) + body[1:]


def write_standing(folder: Path, summary: Summary, mark: tuple[int, ...], now: datetime) -> None:
    """Keep a summary beside the machine, whole or not at all; to be called under the lock.

    OSError where it cannot be written.
    """
    atomic_write(folder / STANDING, standing_content(summary, mark, now), lasting=False)


def _content(folder: Path) -> bytes:
    """Bytes of the file; none where it cannot be read."""
    try:
        return read_regular(folder / STANDING, SMALL)
    except (OSError, ValueError):
        return b""


def _decoded(content: bytes) -> _StandingFile | None:
    """What the file says; None where it is torn, altered or of another form."""
    body = b"{" + content[HEAD:]
    try:
        file = _decode(body) if content[:HEAD] == _head(body) else None
    except (ValueError, TypeError):
        return None
    return file if file is not None and file.make == MAKE else None


def _head(body: bytes) -> bytes:
    """Head of the file: the checksum as the first field."""
    return b'{"crc":"%08x",' % zlib.crc32(body)


@cache
def software() -> str:
    """Version of this program."""
    return version("lobewatch")
