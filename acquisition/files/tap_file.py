"""Tap tests as HDF5 files, one file per test, written whole and never rewritten.

A file is built in memory, written to a temporary name, synced and renamed, so that a file of this name is always
complete. Every dataset has a `units` attribute. There are no pickles, so that h5dump, MATLAB and Julia read it.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import io
import os
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from acquisition.channel import parse_direction
from acquisition.errors import DataError
from acquisition.file_io import MAX_FILE_SIZE, atomic_write, read_regular_file
from acquisition.files import hdf5_file, raw_hits
from acquisition.files.contents.contents import Format
from acquisition.frf import Frf
from acquisition.hit import Hit
from acquisition.hit_fault import HitFlags
from acquisition.hit_quality.decide_hits import decide_stored_hits
from acquisition.subprocess_guard import SUBPROCESS_TIMEOUT, SubprocessService, limit_resources, read_requests
from acquisition.tap_test import Circumstances, Conditions, HitDecision, SourceFile, TapTest

if TYPE_CHECKING:
    import h5py

TAP_FORMAT_NAME = "lobewatch-tap"
TAP_FORMAT_VERSION, TAP_FORMAT_VERSION_WITHOUT_FORCE = 1, 2
"""Version of a file, and of one without force and FRF, which older programs cannot read."""
DAMAGE_ERRORS = (OSError, LookupError, RuntimeError, TypeError, ValueError, ArithmeticError, MemoryError)
"""Errors that damaged HDF5 content leads to."""
FOREIGN_READ_CPU_TIME, FOREIGN_READ_CPU_TIME_PER_BYTE = 3.0, 0.2e-6
"""Processor time of reading a file of unknown origin (s), any file and per byte, chosen.

The slowest of five sound files took 0.08 s (0.6 MB that unpack to 81 MB, 2026-11-27), a usual one 0.006 s.
"""
SOURCE_CHUNK_SIZE = 1_000_000
"""Number of bytes of a replayed file that are packed together."""


def write_tap(path: Path | str, tap: TapTest) -> bytes:
    """Write a tap test with a checksum.

    Parameters
    ----------
    path
        File to write.
    tap
        Tap test.

    Returns
    -------
    bytes
        Content of the file, which is then on the disk.

    Raises
    ------
    OSError
        If the file cannot be written.

    Examples
    --------
    >>> from datetime import UTC, datetime
    >>> from tempfile import TemporaryDirectory
    >>> tested = Circumstances("Mill 3", datetime(2026, 3, 2, 9, 30, tzinfo=UTC), tool="D16")
    >>> frf = from_accelerance(np.arange(100.0, 200.0), np.full(100, 0.5))
    >>> with TemporaryDirectory() as folder:
    ...     _ = write_tap(f"{folder}/tap.h5", TapTest(new_tap_id(tested), tested, frf))
    ...     again = read_tap(f"{folder}/tap.h5")
    >>> again.circumstances.tool, again.frf.frequency.size
    ('D16', 100)
    """
    content = encode_tap(tap)
    atomic_write(Path(path), content)
    return content


def encode_tap(tap: TapTest) -> bytes:
    """Encode the file of a tap test."""
    memory = io.BytesIO()
    with hdf5_file.open_hdf5(memory, "w") as file:
        file.attrs.update(format=TAP_FORMAT_NAME, version=_choose_version(tap.hits))
        file.attrs.update(software=_get_software_name(), id=tap.id)
        _write_circumstances(file, tap.circumstances)
        raw_hits.write_raw_hits(file, tap.hits, tap.flags, tap.decided_flags)
        if tap.frf is not None:
            _write_frf(file, tap.frf, np.float32 if tap.hits else np.float64)
        if tap.source is not None:
            _write_source(file, tap.source)
    return hdf5_file.append_checksum(memory.getvalue())


def _choose_version(hits: Sequence[Hit]) -> int:
    return TAP_FORMAT_VERSION if not hits or hits[0].has_force else TAP_FORMAT_VERSION_WITHOUT_FORCE


@functools.cache
def _get_software_name() -> str:
    """Return name and version; reading the metadata of the package takes as long as writing an FRF."""
    return f"lobewatch {version('lobewatch')}"


def round_as_stored(tap: TapTest) -> TapTest:
    """Return a tap test as its file gives it: with hits, the coherence is rounded to float32."""
    if not tap.hits or tap.frf is None or tap.frf.coherence is None:
        return tap
    return replace(tap, frf=replace(tap.frf, coherence=tap.frf.coherence.astype(np.float32)))


def read_tap(path: Path | str) -> TapTest:
    """Read a tap test.

    Parameters
    ----------
    path
        File that `write_tap` wrote.

    Returns
    -------
    TapTest
        Tap test with all its hits. Its decisions are those behind its FRF; the journal has those that count.

    Raises
    ------
    DataError
        For another or a damaged file.
    """
    with _open_tap_file(Path(path)) as file:
        hits, flags = raw_hits.read_raw_hits(file)
        tap_id, about, frf = file.attrs["id"], _read_circumstances(file), _read_frf(file)
        return TapTest(tap_id, about, frf, hits, flags, _read_source(file), _read_decisions(file, flags))


def _read_decisions(file: h5py.File, flags: Sequence[HitFlags]) -> tuple[HitDecision, ...]:
    """Read the decisions behind the FRF: an averaged hit with faults was accepted, another one without was rejected."""
    averaged = file["raw/accepted"][()].tolist() if flags else []
    return tuple(
        HitDecision(number, "accept" if found else "reject", found.codes)
        for number, (found, is_averaged) in enumerate(zip(flags, averaged, strict=True), 1)
        if bool(found) == is_averaged
    )


def write_hit(path: Path | str, hit: Hit, circumstances: Circumstances, flags: HitFlags) -> None:
    """Write one hit of a test in progress with a checksum, as each sensor measured it.

    The file is on the disk when this returns.

    Parameters
    ----------
    path
        File to write.
    hit
        Hit, with its cross hit.
    circumstances
        Circumstances of the test.
    flags
        Faults of the hit.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    memory = io.BytesIO(_encode_without_hit(circumstances, _choose_version([hit]), raw_hits.HitSettings.from_hit(hit)))
    with hdf5_file.open_hdf5(memory, "r+") as file:
        file.attrs["file"] = Path(path).name
        raw_hits.write_hits(file["raw"], [hit], [flags], [flags])
        if hit.cross_hit is not None:
            raw_hits.write_raw_hits(file.create_group("beside"), [hit.cross_hit], [flags], [flags])
    atomic_write(Path(path), hdf5_file.append_checksum(memory.getvalue()))


@functools.lru_cache(maxsize=1)
def _encode_without_hit(about: Circumstances, version: int, set_up: raw_hits.HitSettings) -> bytes:
    """Encode the file of a hit of this test before the hit is in it, which is a third of the work."""
    memory = io.BytesIO()
    with hdf5_file.open_hdf5(memory, "w") as file:
        file.attrs.update(format=TAP_FORMAT_NAME, version=version)
        _write_circumstances(file, about)
        raw_hits.write_hit_settings(file.create_group("raw"), set_up)
    return memory.getvalue()


def read_tap_hits(path: Path | str) -> tuple[tuple[Hit, ...], Circumstances, tuple[HitFlags, ...]]:
    """Read the hits of a tap file or a hit file.

    Parameters
    ----------
    path
        File that `write_tap` or `write_hit` wrote.

    Returns
    -------
    hits : tuple of Hit
        Hits with their cross hits.
    circumstances : Circumstances
        Circumstances of the test.
    flags : tuple of HitFlags
        Stored faults of each hit.

    Raises
    ------
    DataError
        For another or a damaged file.
    """
    with _open_tap_file(Path(path)) as file:
        hits, flags = raw_hits.read_raw_hits(file)
        if "beside" in file:
            pairs = zip(hits, raw_hits.read_raw_hits(file["beside"])[0], strict=True)
            hits = tuple(replace(hit, cross_hit=cross) for hit, cross in pairs)
        return hits, _read_circumstances(file), flags


def read_circumstances(path: Path | str) -> Circumstances:
    """Read the circumstances of a tap test without its signals. DataError for an unreadable file."""
    with _open_tap_file(Path(path)) as file:
        return _read_circumstances(file)


def read_hit_name(path: Path | str) -> str:
    """Return the name that a hit file was written under; empty in the first ones."""
    with _open_tap_file(Path(path)) as file:
        return str(file.attrs.get("file", ""))


@contextlib.contextmanager
def _open_tap_file(path: Path) -> Iterator[h5py.File]:
    """Open a tap file or hit file. DataError if it is another or a damaged file, also while it is read."""
    content = read_regular_file(path)
    if hdf5_file.has_wrong_checksum(content):
        raise DataError(f"{path}: content changed after writing (SHA-256 differs). Restore the file from a backup.")
    try:
        with hdf5_file.open_hdf5(io.BytesIO(content), "r") as file:
            if file.attrs.get("format") != TAP_FORMAT_NAME:
                fault = f"HDF5 file, but not a tap test of lobewatch (attribute format is not {TAP_FORMAT_NAME!r})"
                raise DataError(f"{path}: {fault}")
            version, newest = int(file.attrs.get("version", TAP_FORMAT_VERSION)), TAP_FORMAT_VERSION_WITHOUT_FORCE
            if version > newest:
                fault = f"tap file version {version} is newer than {newest}, the newest readable version"
                raise DataError(f"{path}: {fault}. Update lobewatch.")
            hdf5_file.check_unpacked_size(file, len(content), path)
            yield file
    except DataError:
        raise
    except KeyError as error:
        raise DataError(f"{path}: incomplete tap file ({error}). Restore the file from a backup.") from error
    except DAMAGE_ERRORS as error:
        fault = f"unreadable or truncated HDF5 file ({error})"
        raise DataError(f"{path}: {fault}. Restore the file from a backup.") from error


def _write_circumstances(file: h5py.File, about: Circumstances) -> None:
    file.attrs["created"] = about.created.isoformat()
    file.attrs["machine_toml_sha256"] = hashlib.sha256(about.machine_toml.encode()).hexdigest()
    for name in ("machine", "tool", "direction", "operator", "device"):
        file.attrs[name] = getattr(about, name).replace("\0", "")  # HDF5 text ends there, and a device may send it
    file.attrs.update(about.conditions.specified)
    file["machine_toml"] = about.machine_toml


def _read_circumstances(file: h5py.File) -> Circumstances:
    machine, tool, operator = (str(file.attrs[name]) for name in ("machine", "tool", "operator"))
    direction, created = parse_direction(str(file.attrs["direction"])), datetime.fromisoformat(file.attrs["created"])
    text, device = file["machine_toml"][()].decode(), str(file.attrs.get("device", ""))
    under = Conditions.from_mapping(raw_hits.convert_to_plain(file.attrs))  # none in the first files
    return Circumstances(machine, created, tool, direction, operator, text, device, under)


def _write_frf(file: h5py.File, frf: Frf, precision: type[np.floating[Any]]) -> None:
    """Write an FRF with this precision of the coherence."""
    group = file.create_group("frf")
    group.attrs.update(n_averages=frf.n_averages, measured_as=frf.measured_as)
    if frf.usable_band is not None:
        group.attrs["usable_band_hz"] = frf.usable_band
    coherence = None if frf.coherence is None else frf.coherence.astype(precision)
    raw_hits.write_dataset(group, "frequency", frf.frequency, "Hz", **raw_hits.HDF5_COMPRESSION)
    group["frequency"].make_scale("frequency")
    for name, values, units in (("receptance", frf.receptance, "m/N"), ("coherence", coherence, "1")):
        if values is not None:
            raw_hits.write_dataset(group, name, values, units, **raw_hits.HDF5_COMPRESSION)
            group[name].dims[0].attach_scale(group["frequency"])


def _read_frf(file: h5py.File) -> Frf | None:
    if "frf" not in file and int(file.attrs.get("version", TAP_FORMAT_VERSION)) == TAP_FORMAT_VERSION_WITHOUT_FORCE:
        return None
    group = file["frf"]
    coherence = group["coherence"][()] if "coherence" in group else None
    frequency, receptance = group["frequency"][()], group["receptance"][()]
    n_averages, measured_as = int(group.attrs["n_averages"]), group.attrs["measured_as"]
    low, high = group.attrs.get("usable_band_hz", (None, None))
    band = None if low is None else (float(low), float(high))
    return Frf(frequency, receptance, coherence, n_averages, measured_as, band)


def _write_source(file: h5py.File, source: SourceFile) -> None:
    content = np.frombuffer(source.content, np.uint8)
    packed = raw_hits.HDF5_COMPRESSION | {"chunks": (min(content.size, SOURCE_CHUNK_SIZE),), "shuffle": False}
    stored = file.create_dataset("source", data=content, **packed if content.size else {})
    stored.attrs.update(name=source.name, sha256=source.sha256, units="byte")


def _read_source(file: h5py.File) -> SourceFile | None:
    if "source" not in file:
        return None
    stored = file["source"]
    content = stored[()].tobytes()
    return SourceFile(str(stored.attrs["name"]), content, "" if content else str(stored.attrs["sha256"]))


_NON_SIGNAL_FLAGS = HitFlags.UNDONE | HitFlags.INCONSISTENT | HitFlags.NARROW_BAND | HitFlags.NOT_EVALUATED
_NON_SIGNAL_FLAGS |= HitFlags.SURPLUS
"""Faults that the time signals of a hit do not show."""


def read_tap_recording(path: Path) -> list[Hit] | Frf:
    """Read the hits of a tap file without those that were rejected for other reasons than their time signals.

    Such hits were undone, hit another spot, had too narrow a force band, were not evaluated, or were not needed.
    Without hits the FRF is read.
    """
    status = path.stat()
    _check_in_subprocess(path, status.st_mtime_ns, status.st_size)
    hits, _, flags = read_tap_hits(path)
    kept = [hit for hit, flag in zip(hits, flags, strict=True) if not flag & _NON_SIGNAL_FLAGS]
    return kept or read_tap(path).required_frf


@functools.lru_cache(maxsize=1000)
def _check_in_subprocess(path: Path, _changed: int, size: int) -> None:
    """Read a file of unknown origin in a subprocess first: HDF5 may crash or hang on it. DataError if it does."""
    try:
        _get_reader(os.getpid()).request(str(path.absolute()), SUBPROCESS_TIMEOUT + _compute_cpu_limit(size))
    except subprocess.SubprocessError as error:
        raise DataError(f"{path}: damaged file, crashes or hangs the reader. Export the file again.") from error


@functools.cache
def _get_reader(_process: int) -> SubprocessService:
    """Return the reader of this process. A fork must not share the answers."""
    return SubprocessService(__name__)


def _compute_cpu_limit(size: int) -> float:
    return FOREIGN_READ_CPU_TIME + FOREIGN_READ_CPU_TIME_PER_BYTE * size


def main() -> None:
    """Read the requested files, each within its processor time. Faults that Python notices are no failure."""
    for name in read_requests():
        with contextlib.suppress(*DAMAGE_ERRORS):
            limit_resources(_compute_cpu_limit(Path(name).stat().st_size), MAX_FILE_SIZE)
            read_tap(name)


def read_judged_tap(path: Path) -> TapTest | None:
    """Read a tap file with hits by its verdicts on all of them, without decisions; None for another file."""
    if not _is_lobewatch_file(read_regular_file(path), path):
        return None
    tap = decide_stored_hits(read_tap(path))
    return tap if tap.hits else None


def _is_lobewatch_file(head: bytes, path: Path) -> bool:
    """Return whether an HDF5 file is of lobewatch, also where it is damaged or no tap file."""
    return head.startswith(hdf5_file.HDF5_SIGNATURE) and b"lobewatch" in read_regular_file(path)


TAP_FORMAT = Format(
    "tap-file",
    "tap file of lobewatch",
    (".h5",),
    _is_lobewatch_file,
    read_tap_recording,
    lambda path: read_tap_hits(path)[1],
    lambda path: decide_stored_hits(read_tap(path)).required_frf,
)

if __name__ == "__main__":
    main()
