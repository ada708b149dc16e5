"""WAV files: a channel each for force and response; their full scale is said by option."""

from __future__ import annotations

import io
import warnings
from pathlib import Path

import numpy as np

from acquisition.errors import DataError
from acquisition.files.contents.contents import Contents, Signal
from acquisition.files.readers.format import Format


def read_wav(path: Path) -> Contents:
    """Its channels as shares of the full scale, -1 to 1; DataError where it is damaged or cut short."""
    import scipy.io.wavfile  # it takes a while, and few files need it

    content = path.read_bytes()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.filterwarnings("ignore", message="Chunk .non-data. not understood", category=Warning)
            rate, values = scipy.io.wavfile.read(io.BytesIO(content))
    except Exception as error:
        raise DataError(f"{path}: damaged, cut short or of a kind that is not read ({error})") from error
    columns = np.atleast_2d(values.T)
    if values.dtype.kind == "u":
        columns = columns.astype(np.float64) - 128
    scale = {"i": 2.0 ** (8 * values.dtype.itemsize - 1), "u": 128.0}.get(values.dtype.kind, 1.0)
    signals = [
        Signal(f"channel {i}", column / scale, rate=float(rate), per_full_scale=True)
        for i, column in enumerate(columns, 1)
    ]
    return Contents(tuple(signals))


def _is_wav(head: bytes, _path: Path) -> bool:
    return head[:4] in (b"RIFF", b"RIFX", b"RF64") and head[8:12] == b"WAVE"


WAV = Format("wav", "WAV file", (".wav",), _is_wav, read_wav)
