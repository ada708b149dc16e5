"""Hits of an interrupted test, read back from its spool; damaged files are set aside, not lost."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from acquisition import Circumstances, Hit, HitFlags, Trigger, read_tap_hits

SETUP = "setup.json"
"""File with the trigger of a test."""


@dataclass(frozen=True, eq=False)
class SpooledHit:
    """One hit from its file."""

    number: int
    """In the name of its file."""
    hit: Hit
    """As it was recorded."""
    flags: HitFlags
    """The verdict of then."""
    circumstances: Circumstances
    """Of the test."""


def spooled_hits(folder: Path, damaged: list[Path]) -> Iterator[SpooledHit]:
    """The sound hits of a test, oldest first; a damaged file is set aside, and where to is added to `damaged`."""
    for path in sorted(folder.glob("[0-9]*.h5")):
        found = _read(path)
        if found is None:
            damaged.append(_set_aside(path))
        else:
            yield found


def spooled_trigger(folder: Path, damaged: list[Path]) -> Trigger | None:
    """How the hits were recorded; None where that was not kept, or is damaged and set aside as hits are."""
    path = folder / SETUP
    try:
        return Trigger(**json.loads(path.read_text("utf-8")))
    except FileNotFoundError:
        return None
    except (ValueError, TypeError):
        damaged.append(_set_aside(path))
        return None


def _read(path: Path) -> SpooledHit | None:
    """A hit; None where its file is damaged."""
    try:
        (hit,), about, (flags,) = read_tap_hits(path)
        return SpooledHit(int(path.stem), hit, flags, about)
    except (ValueError, KeyError, TypeError, RuntimeError):
        return None
    except OSError as error:
        if error.errno is not None:  # of the system, not of HDF5: the file may be sound
            raise
        return None


def _set_aside(path: Path) -> Path:
    """Out of the folder, which is removed when the test is committed."""
    return path.replace(path.parent.with_name(f"{path.parent.name}-{path.name}.damaged"))
