"""Read back the hits of an interrupted test. Damaged files are set aside, not lost.

A hit file ends with its SHA-256 and the set-up holds a CRC-32, so that no damaged data reaches HDF5 or the test.
"""

import contextlib
import json
import zlib
from collections.abc import Iterator
from dataclasses import asdict
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import NamedTuple

from acquisition import Circumstances, Hit, HitFlags, Trigger, atomic_write, read_tap_hits
from acquisition.file_io import (
    MAX_SETTINGS_FILE_SIZE,
    IrregularFileError,
    delete,
    read_regular_file,
    rename,
    retry_while_in_use,
)
from acquisition.files.hdf5_file import has_valid_checksum
from acquisition.files.tap_file import read_hit_name
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.journal.unverified_tap import has_readable_hits

MAX_RESUME_AGE = timedelta(hours=12)
"""Age up to which an interrupted test is resumed."""
TEMPORARY_FILE_PATTERNS = (".journal*.tmp", ".history.*.tmp", "taps/.*.tmp", "spool/**/.*.tmp")
"""Temporary file names of what is written under the lock."""
SETUP_FILE_NAME = "setup.json"
"""File with the trigger settings of a test."""


class SpooledHit(NamedTuple):
    """Hit from its file."""

    number: int
    """Number in the name of its file."""
    hit: Hit
    """Hit as recorded."""
    flags: HitFlags
    """Flags given then."""
    circumstances: Circumstances
    """Circumstances of the test."""


def read_spooled_hits(folder: Path, damaged: list[Path]) -> Iterator[SpooledHit]:
    """Yield the intact hits of a test, oldest first. Damaged files are set aside and added to `damaged`.

    A file under the name of another one is damaged too: no hit counts twice.
    """
    for path in sorted(folder.glob("[0-9]*.h5")):
        hit = _read_spooled_hit(path)
        if hit is None:
            damaged.append(_set_aside(path))
        else:
            yield hit


def count_interrupted_hits(folder: MachineFolder) -> dict[str, int]:
    """Count the stored hits of resumable tests of the tool of machine.toml, by direction."""
    counts: dict[str, int] = {}
    for path in sorted(folder.spool.iterdir()) if folder.spool.is_dir() else []:
        files = sorted(path.glob("[0-9]*.h5"))
        first = next(filter(None, map(_read_spooled_hit, files)), None)
        if first is None or first.circumstances.tool != folder.machine.tap.tool:
            continue
        if datetime.now(UTC) - first.circumstances.created < MAX_RESUME_AGE and path.name not in folder.committed_ids:
            counts[first.circumstances.direction] = len(files)
    return counts


def write_setup(folder: Path, trigger: Trigger) -> None:
    """Store the trigger settings. They are on the disk when this returns."""
    fields = asdict(trigger)
    atomic_write(folder / SETUP_FILE_NAME, json.dumps(fields | {"crc": _compute_crc(fields)}).encode())


def read_spooled_trigger(folder: Path, damaged: list[Path]) -> Trigger | None:
    """Read the trigger settings of the hits. None if they were not stored, or are damaged and set aside."""
    path = folder / SETUP_FILE_NAME
    try:
        fields = json.loads(read_regular_file(path, MAX_SETTINGS_FILE_SIZE))
        crc = fields.pop("crc", None)  # not in the first files
        if crc not in (None, _compute_crc(fields)):
            raise ValueError("altered")
        return Trigger(**fields)
    except FileNotFoundError:
        return None
    except (ValueError, TypeError, AttributeError, RecursionError, IrregularFileError):
        damaged.append(_set_aside(path))
        return None


def clean_spool(folder: MachineFolder) -> None:
    """Remove half-written files and empty folders of an ended program, under the lock.

    Half-written files that programs without the lock may be writing stay.
    """
    for path in [path for names in TEMPORARY_FILE_PATTERNS for path in folder.path.glob(names)]:
        delete(path, missing_ok=True)
    spool = folder.spool
    for path in sorted(spool.iterdir()) if spool.is_dir() else []:
        if path.is_dir():
            if [file.name for file in path.iterdir()] == [SETUP_FILE_NAME]:
                delete(path / SETUP_FILE_NAME)
            with contextlib.suppress(OSError):  # it is not empty
                retry_while_in_use(path.rmdir)


def _compute_crc(fields: object) -> int:
    return zlib.crc32(json.dumps(fields, sort_keys=True).encode())


def _read_spooled_hit(path: Path) -> SpooledHit | None:
    """Read a hit. None if its file is damaged."""
    try:
        is_sound = has_valid_checksum(read_regular_file(path)) or has_readable_hits(path)
        if not is_sound or read_hit_name(path) not in ("", path.name):
            return None
        (hit,), about, (flags,) = read_tap_hits(path)
        return SpooledHit(int(path.stem), hit, flags, about)
    except (ValueError, KeyError, TypeError, RuntimeError, IrregularFileError):
        return None
    except OSError as error:
        if error.errno is not None:  # of the system, not of HDF5: the file may be sound
            raise
        return None


def _set_aside(path: Path) -> Path:
    """Move a file out of the folder, which is removed on commit, under an unused name."""
    name, number = f"{path.parent.name}-{path.name}", 1
    while (aside := path.parent.with_name(f"{name}.damaged")).exists():
        number += 1
        name = f"{path.parent.name}-{path.name}.{number}"
    return rename(path, aside)
