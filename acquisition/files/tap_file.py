"""Tap tests as HDF5 files, one file a test, written whole and never rewritten.

Built in memory, then temporary name + fsync + rename: a file of this name is always complete. Every dataset has a
`units` attribute; no pickles, so that h5dump, MATLAB and Julia read it.
"""

from __future__ import annotations

import functools
import hashlib
import io
from collections.abc import Sequence
from dataclasses import fields, replace
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from acquisition.atomic import atomic_write
from acquisition.channel import Channel, tap_direction
from acquisition.errors import DataError
from acquisition.files.readers.hdf5_in import hdf5_in
from acquisition.files.readers.unpacked import check_unpacked
from acquisition.files.seal import is_broken, sealed
from acquisition.frf import Frf
from acquisition.hit import Hit, HitFlags
from acquisition.regular_file import read_regular
from acquisition.tap import Circumstances, Conditions, SourceFile, TapTest

if TYPE_CHECKING:
    import h5py

FORMAT = "lobewatch-tap"
VERSION, WITHOUT_FORCE = 1, 2
"""Version of a file, and that of one without force and FRF, which older programs cannot read."""
CHUNK = 1_000_000
"""Bytes of a replayed file that are packed together."""
PACKED = {"compression": "gzip", "compression_opts": 1, "shuffle": True, "fletcher32": True}


def write_tap(path: Path | str, tap: TapTest) -> bytes:
    """Write a tap test, sealed; returns the bytes of the file, on the disk when this returns. OSError where that fails.

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
    content = tap_content(tap)
    atomic_write(Path(path), content)
    return content


def tap_content(tap: TapTest) -> bytes:
    """The bytes of the file of a tap test."""
    memory = io.BytesIO()
    with hdf5_in(memory, "w") as file:
        file.attrs.update(format=FORMAT, version=_version(tap.hits), software=_software(), id=tap.id)
        _write_circumstances(file, tap.circumstances)
        _write_raw(file, tap.hits, tap.flags)
        if tap.frf is not None:
            _write_frf(file, tap.frf, np.float32 if tap.hits else np.float64)
        if tap.source is not None:
            _write_source(file, tap.source)
    return sealed(memory.getvalue())


def _version(hits: Sequence[Hit]) -> int:
    return VERSION if not hits or hits[0].has_force else WITHOUT_FORCE


@functools.cache
def _software() -> str:
    """Reading the metadata of the package takes as long as writing an FRF."""
    return f"lobewatch {version('lobewatch')}"


def as_written(tap: TapTest) -> TapTest:
    """The tap test as it is read from its file: where the hits are there the coherence is rounded to float32."""
    if not tap.hits or tap.frf is None or tap.frf.coherence is None:
        return tap
    return replace(tap, frf=replace(tap.frf, coherence=tap.frf.coherence.astype(np.float32)))


def read_tap(path: Path | str) -> TapTest:
    """A tap test from its file; DataError where it is none or damaged."""
    with _open(Path(path)) as file:
        try:
            hits, flags = _read_raw(file)
            return TapTest(
                file.attrs["id"], _read_circumstances(file), _read_frf(file), hits, flags, _read_source(file)
            )
        except KeyError as error:
            raise DataError(f"{path}: incomplete tap file ({error}); take it again from a backup") from error


def write_hit(path: Path | str, hit: Hit, circumstances: Circumstances, flags: HitFlags) -> None:
    """One hit of a test in progress, as each sensor felt it, and the verdict on it, sealed; on the disk when this
    returns, else OSError."""
    memory = io.BytesIO()
    with hdf5_in(memory, "w") as file:
        file.attrs.update(format=FORMAT, version=_version([hit]), file=Path(path).name)
        _write_circumstances(file, circumstances)
        _write_raw(file, [hit], [flags])
        if hit.beside is not None:
            _write_raw(file.create_group("beside"), [hit.beside], [flags])
    atomic_write(Path(path), sealed(memory.getvalue()))


def read_tap_hits(path: Path | str) -> tuple[tuple[Hit, ...], Circumstances, tuple[HitFlags, ...]]:
    """The hits of a tap file or of a hit file, their circumstances, and the verdicts of then; DataError as read_tap."""
    with _open(Path(path)) as file:
        hits, flags = _read_raw(file)
        if "beside" in file:
            pairs = zip(hits, _read_raw(file["beside"])[0], strict=True)
            hits = tuple(replace(hit, beside=beside) for hit, beside in pairs)
        return hits, _read_circumstances(file), flags


def read_hit_name(path: Path | str) -> str:
    """The name that a hit file was written under; empty in the first ones."""
    with _open(Path(path)) as file:
        return str(file.attrs.get("file", ""))


def _open(path: Path) -> h5py.File:
    content = read_regular(path)
    if is_broken(content):
        raise DataError(f"{path}: altered since it was written (SHA-256 differs); take it again from a backup")
    try:
        file = hdf5_in(io.BytesIO(content), "r")
    except OSError as error:
        raise DataError(f"{path}: no readable HDF5 file ({error}); is it cut short?") from error
    try:
        if file.attrs.get("format") != FORMAT:
            raise DataError(f"{path}: an HDF5 file, but no tap test of lobewatch (attribute format is not {FORMAT!r})")
        newest = int(file.attrs.get("version", VERSION))
        if newest > WITHOUT_FORCE:
            versions = f"a tap file of version {newest}, this lobewatch reads up to {WITHOUT_FORCE}"
            raise DataError(f"{path}: {versions}; update lobewatch")
        check_unpacked(file, len(content), path)
    except (OSError, LookupError, RuntimeError) as error:
        file.close()
        raise DataError(f"{path}: no readable HDF5 file ({error}); is it cut short?") from error
    except BaseException:
        file.close()
        raise
    return file


def _write_circumstances(file: h5py.File, about: Circumstances) -> None:
    file.attrs["created"] = about.created.isoformat()
    file.attrs["machine_toml_sha256"] = hashlib.sha256(about.machine_toml.encode()).hexdigest()
    for name in ("machine", "tool", "direction", "operator", "device"):
        file.attrs[name] = getattr(about, name).replace("\0", "")  # HDF5 text ends there, and a device may send it
    file.attrs.update(about.conditions.known)
    file["machine_toml"] = about.machine_toml


def _read_circumstances(file: h5py.File) -> Circumstances:
    named = {name: str(file.attrs[name]) for name in ("machine", "tool", "operator")}
    direction = tap_direction(str(file.attrs["direction"]))
    created = datetime.fromisoformat(file.attrs["created"])
    device = str(file.attrs.get("device", ""))
    text = file["machine_toml"][()].decode()
    under = Conditions.of(_plain(file.attrs))  # none in the first files
    return Circumstances(
        created=created, direction=direction, machine_toml=text, device=device, conditions=under, **named
    )


def _dataset(group: h5py.Group, name: str, data: Any, units: str, **options: Any) -> None:
    group.create_dataset(name, data=data, **options).attrs["units"] = units


def _write_raw(file: h5py.Group, hits: Sequence[Hit], flags: Sequence[HitFlags]) -> None:
    if not hits:
        return
    raw = file.create_group("raw")
    first = hits[0]
    if first.codes is not None and first.channels is not None:
        word = np.int16 if max(channel.adc_bits for channel in first.channels) <= 16 else np.int32
        codes = np.stack([hit.codes for hit in hits if hit.codes is not None]).astype(word)
        _dataset(raw, "codes", codes, "ADC code", chunks=(1, *codes.shape[1:]), **PACKED)
        for i, channel in enumerate(first.channels):
            raw.create_group(f"channel_{i}").attrs.update(
                {field.name: getattr(channel, field.name) for field in fields(Channel)}
            )
    else:
        samples = np.stack([hit.signals for hit in hits])
        _dataset(
            raw,
            "samples",
            samples,
            "N, m/s^2" if first.has_force else "m/s^2",
            chunks=(1, *samples.shape[1:]),
            **PACKED,
        )
    raw.attrs.update(sample_rate_hz=first.sample_rate, pre_trigger_samples=first.pre_trigger)
    _dataset(raw, "lost_scans", [hit.lost_scans for hit in hits], "1")
    _dataset(raw, "overload", [hit.overload for hit in hits], "1")
    _dataset(raw, "accepted", [not flag for flag in flags], "1")
    raw["verdict"] = [flag.words for flag in flags]


def _read_raw(file: h5py.Group) -> tuple[tuple[Hit, ...], tuple[HitFlags, ...]]:
    if "raw" not in file:
        return (), ()
    raw = file["raw"]
    rate, before = float(raw.attrs["sample_rate_hz"]), int(raw.attrs["pre_trigger_samples"])
    lost = raw["lost_scans"][()].tolist()
    overload = raw["overload"][()].tolist() if "overload" in raw else [0] * len(lost)  # not in the first files
    flags = tuple(HitFlags.from_words(words) for words in raw["verdict"].asstr()[()])
    if "codes" in raw:
        rows = raw["codes"][()]
        channels = tuple(_read_channel(raw[f"channel_{i}"]) for i in range(rows.shape[1]))
        coded = zip(rows, lost, overload, strict=True)
        return tuple(Hit.from_codes(codes, channels, rate, before, n, mask) for codes, n, mask in coded), flags
    sampled = zip(raw["samples"][()], lost, overload, strict=True)
    nothing = np.empty(0)
    return tuple(
        Hit(signals[0] if len(signals) > 1 else nothing, signals[-1], rate, before, n, overload=mask)
        for signals, n, mask in sampled
    ), flags


def _read_channel(group: h5py.Group) -> Channel:
    return Channel(**_plain(group.attrs))


def _plain(attributes: h5py.AttributeManager) -> dict[str, Any]:
    return {name: value.item() if isinstance(value, np.generic) else value for name, value in attributes.items()}


def _write_frf(file: h5py.File, frf: Frf, precision: type[np.floating[Any]]) -> None:
    """precision: of the coherence."""
    group = file.create_group("frf")
    group.attrs.update(n_averages=frf.n_averages, measured_as=frf.measured_as)
    if frf.usable_band is not None:
        group.attrs["usable_band_hz"] = frf.usable_band
    coherence = None if frf.coherence is None else frf.coherence.astype(precision)
    _write_lines(group, frf.frequency, receptance=(frf.receptance, "m/N"), coherence=(coherence, "1"))


def _write_lines(
    group: h5py.Group, frequency: NDArray[np.floating[Any]], **arrays: tuple[NDArray[Any] | None, str]
) -> None:
    """Arrays over frequency, which becomes their dimension scale."""
    _dataset(group, "frequency", frequency, "Hz", **PACKED)
    group["frequency"].make_scale("frequency")
    for name, (data, units) in arrays.items():
        if data is not None:
            _dataset(group, name, data, units, **PACKED)
            group[name].dims[0].attach_scale(group["frequency"])


def _read_frf(file: h5py.File) -> Frf | None:
    if "frf" not in file and int(file.attrs.get("version", VERSION)) == WITHOUT_FORCE:
        return None
    group = file["frf"]
    coherence = group["coherence"][()] if "coherence" in group else None
    band = group.attrs.get("usable_band_hz")
    return Frf(
        group["frequency"][()],
        group["receptance"][()],
        coherence,
        int(group.attrs["n_averages"]),
        group.attrs["measured_as"],
        None if band is None else (float(band[0]), float(band[1])),
    )


def _write_source(file: h5py.File, source: SourceFile) -> None:
    content = np.frombuffer(source.content, np.uint8)
    packed = {"chunks": (min(content.size, CHUNK),), "compression": "gzip", "compression_opts": 1, "fletcher32": True}
    stored = file.create_dataset("source", data=content, **packed if content.size else {})
    stored.attrs.update(name=source.name, sha256=source.sha256, units="byte")


def _read_source(file: h5py.File) -> SourceFile | None:
    if "source" not in file:
        return None
    stored = file["source"]
    content = stored[()].tobytes()
    return SourceFile(str(stored.attrs["name"]), content, "" if content else str(stored.attrs["sha256"]))
