"""SLD history as an HDF5 file.

bytes 0..511           (HDF5 user block) "lobewatch-history 1 sha256 ..." of all that follows
/                      format "lobewatch-history", version, settings_hash, software
/speed_rpm             (m,), rpm, the dimension scale of every limiting_depth
/columns/NAME          (n,) or (n, k), with units; text as variable-length UTF-8
/cuts/0, /cuts/1 ...   name
/cuts/0/limiting_depth (n, m), m
"""

import hashlib
import io
import os
from pathlib import Path

import h5py
import numpy as np

from acquisition import atomic_write
from lobes.history import Column, SldHistory

HISTORY_FORMAT = "lobewatch-history"
HISTORY_FORMAT_VERSION = 1
HISTORY_HEAD_SIZE = 512
"""Smallest user block of HDF5 (bytes)."""


def write_history(path: str | os.PathLike[str], history: SldHistory) -> None:
    """Write a history to a file: completely, or not at all.

    Parameters
    ----------
    path : str or path-like
        File to be replaced.
    history : SldHistory
        History.

    Raises
    ------
    OSError
        If writing fails; the old file stays.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> speeds = np.linspace(4000.0, 18000.0, 8)  # rpm
    >>> columns, depth = {"frequency": np.array([696.2])}, {"slot": np.full((1, 8), 1.2e-3)}
    >>> history = SldHistory("", "lobewatch", speeds, columns, depth)
    >>> with TemporaryDirectory() as folder:
    ...     write_history(f"{folder}/history.h5", history)
    ...     again = read_history(f"{folder}/history.h5")
    >>> again.columns["frequency"].tolist()
    [696.2]
    """
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", userblock_size=HISTORY_HEAD_SIZE) as file:
        file.attrs.update(format=HISTORY_FORMAT, version=HISTORY_FORMAT_VERSION)
        file.attrs.update(settings_hash=history.settings_hash, software=history.software)
        speed = file.create_dataset("speed_rpm", data=history.speed_rpm)
        speed.attrs["units"] = "rpm"
        speed.make_scale("speed_rpm")
        columns = file.create_group("columns", track_order=True)
        for name, values in history.columns.items():
            _write_column(columns, name, values, history.units.get(name))
        cuts = file.create_group("cuts")
        for i, (name, depth) in enumerate(history.depth.items()):
            cut = cuts.create_group(str(i))
            cut.attrs["name"] = name
            dataset = cut.create_dataset("limiting_depth", data=depth)
            dataset.attrs["units"] = "m"
            dataset.dims[1].attach_scale(speed)
    body = buffer.getvalue()[HISTORY_HEAD_SIZE:]
    atomic_write(Path(path), _file_head(body) + body)


def read_history(path: str | os.PathLike[str]) -> SldHistory:
    """Read a history from a file.

    The checksum is verified before HDF5 sees the file: one flipped bit can make HDF5 hang, or pass unnoticed.

    Parameters
    ----------
    path : str or path-like
        File.

    Returns
    -------
    SldHistory
        History.

    Raises
    ------
    FileNotFoundError
        If the file does not exist.
    ValueError
        If the file is damaged or no history.
    """
    content = Path(path).read_bytes()
    if content[:HISTORY_HEAD_SIZE] != _file_head(content[HISTORY_HEAD_SIZE:]):
        wanted = f"{HISTORY_FORMAT} file of version {HISTORY_FORMAT_VERSION}"
        raise ValueError(f"{os.fspath(path)}: damaged, or not a {wanted}. Rebuild the history from the tap tests.")
    with h5py.File(io.BytesIO(content), "r") as file:
        columns, cuts = file["columns"], file["cuts"]
        return SldHistory(
            settings_hash=file.attrs["settings_hash"],
            software=file.attrs["software"],
            speed_rpm=file["speed_rpm"][...],
            columns={name: _read_column(dataset) for name, dataset in columns.items()},
            depth={cuts[i].attrs["name"]: cuts[i]["limiting_depth"][...] for i in sorted(cuts, key=int)},
            units={name: dataset.attrs["units"] for name, dataset in columns.items() if "units" in dataset.attrs},
        )


def _file_head(body: bytes) -> bytes:
    head = f"{HISTORY_FORMAT} {HISTORY_FORMAT_VERSION} sha256 {hashlib.sha256(body).hexdigest()}\n"
    return head.encode().ljust(HISTORY_HEAD_SIZE, b"\0")


def _write_column(columns: h5py.Group, name: str, values: Column, units: str | None) -> None:
    data, kind = (values.astype(object), h5py.string_dtype()) if values.dtype.kind == "U" else (values, None)
    dataset = columns.create_dataset(name, data=data, dtype=kind)
    if units is not None:
        dataset.attrs["units"] = units


def _read_column(dataset: h5py.Dataset) -> Column:
    text = h5py.check_string_dtype(dataset.dtype) is not None
    return np.asarray(dataset.asstr()[...], dtype=np.str_) if text else np.asarray(dataset[...])
