"""Read WAV, FLAC and MP3 files with one channel per sensor.

WAV is read by scipy, FLAC and MP3 by soundfile where that is installed (`pip install "lobewatch[sound]"`).
"""

import io
import warnings
from pathlib import Path

import numpy as np

from acquisition.arrays import Floats
from acquisition.errors import DataError
from acquisition.files.contents.contents import Contents, Format, Signal

MP3_SYNC_BITS = 0xFFE0
"""First bits of a frame of an MP3 file."""


def read_audio(path: Path) -> Contents:
    """Read the channels as shares of the full scale, -1 to 1.

    Raises DataError if the file is damaged or cut short, or soundfile is not installed.
    """
    with path.open("rb") as file:
        is_wav = _is_wav(file.read(12))
    rate, columns = _read_wav(path) if is_wav else _read_flac_or_mp3(path)
    signals = (Signal(f"channel {i}", column, rate=rate, per_full_scale=True) for i, column in enumerate(columns, 1))
    return Contents(tuple(signals))


def _read_wav(path: Path) -> tuple[float, Floats]:
    """Read sample rate and channels of a WAV file."""
    import scipy.io.wavfile  # it takes a while, and few files need it

    content = path.read_bytes()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.filterwarnings("ignore", message="Chunk .non-data. not understood", category=Warning)
            rate, values = scipy.io.wavfile.read(io.BytesIO(content))
    except Exception as error:
        raise DataError(f"{path}: damaged, truncated or unsupported audio file ({error}). Export WAV.") from error
    columns = np.atleast_2d(values.T)
    if values.dtype.kind == "u":
        columns = columns.astype(np.float64) - 128
    scale = {"i": 2.0 ** (8 * values.dtype.itemsize - 1), "u": 128.0}.get(values.dtype.kind, 1.0)
    return float(rate), columns / scale


def _read_flac_or_mp3(path: Path) -> tuple[float, Floats]:
    """Read sample rate and channels of a FLAC or MP3 file."""
    try:
        import soundfile
    except ImportError as error:
        cure = 'Export WAV, or install the package with pip install "lobewatch[sound]".'
        raise DataError(f"{path}: FLAC and MP3 need the package soundfile. {cure}") from error
    try:
        values, rate = soundfile.read(io.BytesIO(path.read_bytes()), dtype="float64", always_2d=True)
    except Exception as error:
        raise DataError(f"{path}: damaged, truncated or unsupported audio file ({error}). Export WAV.") from error
    return float(rate), values.T


def _is_wav(head: bytes) -> bool:
    return head[:4] in (b"RIFF", b"RIFX", b"RF64") and head[8:12] == b"WAVE"


def _is_audio(head: bytes, _path: Path) -> bool:
    is_frame = int.from_bytes(head[:2], "big") & MP3_SYNC_BITS == MP3_SYNC_BITS and head[1] & 0x06 == 0x02
    return _is_wav(head) or head[:4] == b"fLaC" or head[:3] == b"ID3" or is_frame


AUDIO_FORMAT = Format("wav", "WAV, FLAC or MP3 file", (".wav", ".flac", ".mp3"), _is_audio, read_audio)
