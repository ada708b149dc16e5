"""The variables of a MATLAB or HDF5 file, read by a program of its own: scipy and HDF5 crash or hang on damaged ones.

That program hands them over as MessagePack: structs as maps, cells as lists, arrays as `numpy.save` writes them, what
no layout reads as nil; a text in their place says why the file cannot be read.
"""

from __future__ import annotations

import io
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import msgspec
import numpy as np

from acquisition.apart import limit_this_program, run_apart
from acquisition.errors import DataError
from acquisition.files.readers.hdf5_in import HDF5
from acquisition.files.readers.unpacked import HARMLESS, RATIO, check_unpacked

SECONDS, SECONDS_PER_BYTE = 2.0, 0.2e-6
"""Processor time that reading may take (s), for any file and for each byte of it: 20 times what sound ones take."""
STARVED = 30.0
"""Time for which it is waited over that, on a computer that has other work or no such limit."""
COPIES = 6
"""Memory that reading may take, over the size of what is read at most."""
V73 = b"MATLAB 7.3 MAT-file"
"""First bytes of a file that is HDF5, as MATLAB writes it."""
ARRAY = 1
"""Number of the MessagePack extension that holds an array."""


def mat_variables(path: Path) -> dict[str, Any]:
    """All of them by name; DataError where the file is damaged or unpacks out of proportion."""
    try:
        content = run_apart(__name__, str(path), patience=STARVED * _seconds(path.stat().st_size))
    except subprocess.SubprocessError as error:
        raise DataError(f"{path}: damaged: its reader crashes or hangs on it; export it anew") from error
    answer: dict[str, Any] | str = msgspec.msgpack.decode(content, ext_hook=_array)
    if isinstance(answer, str):
        raise DataError(answer)
    return answer


def _array(_number: int, content: memoryview) -> Any:
    values = np.load(io.BytesIO(content), allow_pickle=False)
    return values if values.ndim else values[()]


def main() -> None:
    """Write the variables of the file that is named to standard output."""
    sys.stdout.buffer.write(_answer(Path(sys.argv[1])))


def _answer(path: Path) -> bytes:
    encode = msgspec.msgpack.Encoder(enc_hook=_packed).encode
    try:
        with path.open("rb") as file:
            is_hdf5 = file.read(len(V73)).startswith((V73, HDF5))
        return encode(_of_hdf5(path) if is_hdf5 else _of_matrices(path))
    except DataError as error:
        return encode(str(error))
    except Exception as error:  # noqa: BLE001 - whatever a damaged file leads to
        return encode(f"{path}: damaged or cut short ({type(error).__name__}: {error}); export it anew")


def _seconds(size: int) -> float:
    return SECONDS + SECONDS_PER_BYTE * size


def _limit(size: int) -> None:
    """For a file of so many bytes."""
    limit_this_program(_seconds(size), COPIES * max(HARMLESS, RATIO * size))


def _of_matrices(path: Path) -> dict[str, Any]:
    """Variables of v4 and v5 by name."""
    import scipy.io  # it takes a while, and HDF5 does not need it

    size = path.stat().st_size
    _limit(size)
    try:
        unpacked = sum(16 * math.prod(shape) for _, shape, _ in scipy.io.whosmat(path))
    except TypeError:  # scipy names no shape of MATLAB's own objects (a table, a system), and passes over them
        unpacked = 0
    if unpacked > max(HARMLESS, RATIO * size):
        raise DataError(f"{path}: {size / 1e6:.3g} MB that unpack to {unpacked / 1e6:.4g} MB; no tap test does")
    variables = scipy.io.loadmat(path, simplify_cells=True)
    return {name: value for name, value in variables.items() if not name.startswith("__")}


def _of_hdf5(path: Path) -> dict[str, Any]:
    """The same of v7.3: arrays transposed, complex numbers as pairs, text as 16-bit codes."""
    size = path.stat().st_size
    _limit(size)
    with h5py.File(path, "r") as file:
        check_unpacked(file, size, path)
        return {name: _plain(node) for name, node in file.items() if name != "#refs#"}


def _plain(node: Any) -> Any:
    if isinstance(node, h5py.Group):
        return {name: _plain(child) for name, child in node.items()}
    values = node[()]
    if isinstance(values, bytes | h5py.Empty):
        return None
    kind = node.attrs.get("MATLAB_class", b"")
    if node.attrs.get("MATLAB_empty", 0):
        return np.empty(0)
    if values.dtype.names == ("real", "imag"):
        values = values["real"] + 1j * values["imag"]
    if values.dtype.kind == "O":
        cells = [_plain(node.file[cell]) for cell in values.ravel() if isinstance(cell, h5py.Reference)]
        return cells[0] if len(cells) == 1 else cells
    if kind == b"char":
        return "".join(map(chr, values.T.ravel()))
    squeezed = np.squeeze(values.T)
    return squeezed[()] if squeezed.ndim == 0 else squeezed


def _packed(value: object) -> object:
    """What MessagePack has no form of; structs that stand in matrices have their names beside them."""
    if hasattr(value, "_fieldnames"):
        return {name: field for name, field in vars(value).items() if name != "_fieldnames"}
    if not isinstance(value, np.ndarray | np.generic) or value.dtype.kind not in "biufcSUO":
        return None
    if value.dtype.kind == "O":
        return value.tolist()
    content = io.BytesIO()
    np.save(content, value, allow_pickle=False)
    return msgspec.msgpack.Ext(ARRAY, content.getbuffer())


if __name__ == "__main__":
    main()
