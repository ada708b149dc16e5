"""Read the variables of a MATLAB or HDF5 file in a subprocess, as damaged files may crash or hang.

The subprocess returns them as MessagePack: structs as maps, cells as lists, arrays as `numpy.save` writes them, and nil
for other types. A text in their place states why the file cannot be read.
"""

import io
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import h5py
import msgspec
import numpy as np

from acquisition.errors import DataError
from acquisition.files.hdf5_file import HDF5_SIGNATURE, check_unpacked_size, check_unpacked_total, get_unpacked_limit
from acquisition.subprocess_guard import limit_resources, run_in_subprocess

READ_CPU_TIME, READ_CPU_TIME_PER_BYTE = 2.0, 0.2e-6
"""Processor time of reading (s), for any file and per byte: 20 times what sound files take."""
READ_TIMEOUT_FACTOR = 30.0
"""Waiting time over the processor time, for a busy computer or one without such a limit."""
READ_MEMORY_FACTOR = 6
"""Memory of reading over the largest unpacked size."""
MAT_V73_SIGNATURE = b"MATLAB 7.3 MAT-file"
"""First bytes of a file that is HDF5, as MATLAB writes it."""
ARRAY_EXTENSION_CODE = 1
"""Code of the MessagePack extension with an array."""


def read_mat_variables(path: Path) -> dict[str, Any]:
    """Read all variables by name; raise DataError if the file is damaged or unpacks out of proportion."""
    try:
        patience = READ_TIMEOUT_FACTOR * _compute_cpu_limit(path.stat().st_size)
        content = run_in_subprocess(__name__, str(path), patience=patience)
    except subprocess.SubprocessError as error:
        raise DataError(f"{path}: damaged file, crashes or hangs the reader. Export the file again.") from error
    answer: dict[str, Any] | str = msgspec.msgpack.decode(content, ext_hook=_decode_array)
    if isinstance(answer, str):
        raise DataError(answer)
    return answer


def _decode_array(_number: int, content: memoryview) -> Any:
    values = np.load(io.BytesIO(content), allow_pickle=False)
    return values if values.ndim else values[()]


def main() -> None:
    """Write the variables of the named file to standard output."""
    sys.stdout.buffer.write(_encode_answer(Path(sys.argv[1])))


def _encode_answer(path: Path) -> bytes:
    encode = msgspec.msgpack.Encoder(enc_hook=_encode_value).encode
    try:
        with path.open("rb") as file:
            is_hdf5 = file.read(len(MAT_V73_SIGNATURE)).startswith((MAT_V73_SIGNATURE, HDF5_SIGNATURE))
        return encode(_read_v73(path) if is_hdf5 else _read_v5(path))
    except DataError as error:
        return encode(str(error))
    except Exception as error:  # noqa: BLE001 - whatever a damaged file leads to
        return encode(f"{path}: damaged or truncated file ({type(error).__name__}: {error}). Export the file again.")


def _compute_cpu_limit(size: int) -> float:
    return READ_CPU_TIME + READ_CPU_TIME_PER_BYTE * size


def _limit_for_size(size: int) -> None:
    limit_resources(_compute_cpu_limit(size), READ_MEMORY_FACTOR * get_unpacked_limit(size))


def _read_v5(path: Path) -> dict[str, Any]:
    """Read the variables of v4 and v5 by name."""
    import scipy.io  # it takes a while, and HDF5 does not need it

    _limit_for_size(path.stat().st_size)
    try:
        unpacked = sum(16 * math.prod(shape) for _, shape, _ in scipy.io.whosmat(path))
    except TypeError:  # scipy names no shape of MATLAB's own objects (a table, a system), and passes over them
        unpacked = 0
    check_unpacked_total(unpacked, path.stat().st_size, path)
    variables = scipy.io.loadmat(path, simplify_cells=True)
    return {name: value for name, value in variables.items() if not name.startswith("__")}


def _read_v73(path: Path) -> dict[str, Any]:
    """Read the variables of v7.3 by name: arrays transposed, complex numbers as pairs, text as 16-bit codes."""
    _limit_for_size(path.stat().st_size)
    with h5py.File(path, "r") as file:
        check_unpacked_size(file, path.stat().st_size, path)
        return {name: _convert_node(node) for name, node in file.items() if name != "#refs#"}


def _convert_node(node: Any) -> Any:
    if isinstance(node, h5py.Group):
        return {name: _convert_node(child) for name, child in node.items()}
    values = node[()]
    if isinstance(values, bytes | h5py.Empty):
        return None
    kind = node.attrs.get("MATLAB_class", b"")
    if node.attrs.get("MATLAB_empty", 0):
        return np.empty(0)
    if values.dtype.names == ("real", "imag"):
        values = values["real"] + 1j * values["imag"]
    if values.dtype.kind == "O":
        cells = [_convert_node(node.file[cell]) for cell in values.ravel() if isinstance(cell, h5py.Reference)]
        return cells[0] if len(cells) == 1 else cells
    if kind == b"char":
        return "".join(map(chr, values.T.ravel()))
    squeezed = np.squeeze(values.T)
    return squeezed[()] if squeezed.ndim == 0 else squeezed


def _encode_value(value: object) -> object:
    """Encode a value that MessagePack has no form of; structs in matrices have their names in `_fieldnames`."""
    if hasattr(value, "_fieldnames"):
        return {name: field for name, field in vars(value).items() if name != "_fieldnames"}
    if not isinstance(value, np.ndarray | np.generic) or value.dtype.kind not in "biufcSUO":
        return None
    if value.dtype.kind == "O":
        return value.tolist()
    content = io.BytesIO()
    np.save(content, value, allow_pickle=False)
    return msgspec.msgpack.Ext(ARRAY_EXTENSION_CODE, content.getbuffer())


if __name__ == "__main__":
    main()
