"""Read sound files with one channel per sensor.

scipy reads WAV. The package soundfile reads FLAC, MP3, OGG and WAV with compressed samples, PyAV reads M4A and WebM.
Both packages are optional (`pip install "lobewatch[phone]"`).
"""

import io
import math
import warnings
from pathlib import Path

import numpy as np

from acquisition.arrays import Floats
from acquisition.errors import DataError
from acquisition.files.contents.contents import Contents, Format, Signal

MP3_SYNC_BITS = 0xFFE0
"""First bits of a frame of an MP3 file."""
WAV_SAMPLE_TAGS = (1, 3, 0xFFFE)
"""Format tags of WAV files with uncompressed samples: integers, floats, and either one by its subformat."""


class MissingDecoderError(DataError):
    """Raised if the package that reads a sound file is not installed."""


def read_audio(path: Path) -> Contents:
    """Read the channels as shares of the full scale, -1 to 1.

    Raises DataError if the file is no sound, damaged or cut short, or its decoder is not installed.
    """
    content = path.read_bytes()
    if not _has_signature(content[:12]):
        raise DataError(f"{path}: not a {AUDIO_FORMAT.title}. Export WAV.")
    rate, columns = decode_audio(content, str(path))
    signals = (Signal(f"channel {i}", column, rate=rate, per_full_scale=True) for i, column in enumerate(columns, 1))
    return Contents(tuple(signals))


def decode_audio(content: bytes, name: str, max_seconds: float = math.inf) -> tuple[float, Floats]:
    """Return the sample rate (Hz) and the channels of a sound file as shares of the full scale.

    Parameters
    ----------
    content
        Bytes of the file.
    name
        Name of the file in messages.
    max_seconds
        Length (s) beyond which decoding of a compressed file stops. It may return slightly more.

    Returns
    -------
    tuple of float and ndarray, shape (channels, n)
        Sample rate (Hz) and samples.

    Raises
    ------
    MissingDecoderError
        If the package for this format is not installed.
    DataError
        If the file is damaged, truncated or of another format.
    """
    try:
        if _is_wav(content[:12]) and _wav_sample_tag(content) in WAV_SAMPLE_TAGS:
            return _decode_wav(content)
        decode = _decode_by_av if _find_demuxer(content[:12]) else _decode_by_soundfile
        rate, columns = decode(content, name, max_seconds)
        return rate, np.clip(columns, -1.0, 1.0)  # lossy coding overshoots the rails of a clipped recording
    except (DataError, MemoryError):
        raise
    except Exception as error:
        fault = getattr(error, "error_string", error)  # that of soundfile has no address of its input
        raise DataError(f"{name}: damaged, truncated or unsupported audio file ({fault}). Export WAV.") from error


def _decode_wav(content: bytes) -> tuple[float, Floats]:
    import scipy.io.wavfile  # it takes a while, and few files need it

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", message="Chunk .non-data. not understood", category=Warning)
        rate, values = scipy.io.wavfile.read(io.BytesIO(content))
    columns = np.atleast_2d(values.T)
    if values.dtype.kind == "u":
        columns = columns.astype(np.float64) - 128
    scale = {"i": 2.0 ** (8 * values.dtype.itemsize - 1), "u": 128.0}.get(values.dtype.kind, 1.0)
    return float(rate), columns / scale


def _decode_by_soundfile(content: bytes, name: str, max_seconds: float) -> tuple[float, Floats]:
    try:
        import soundfile
    except ImportError as error:
        cure = 'Export WAV, or install the package with pip install "lobewatch[sound]".'
        raise MissingDecoderError(f"{name}: FLAC, MP3 and OGG need the package soundfile. {cure}") from error
    with soundfile.SoundFile(io.BytesIO(content)) as file:
        count = -1 if math.isinf(max_seconds) else math.ceil(max_seconds * file.samplerate) + 1
        return float(file.samplerate), file.read(count, dtype="float64", always_2d=True).T


def _decode_by_av(content: bytes, name: str, max_seconds: float) -> tuple[float, Floats]:
    try:
        import av
    except ImportError as error:
        cure = 'Export WAV, or install the package with pip install "lobewatch[phone]".'
        raise MissingDecoderError(f"{name}: M4A and WebM need the package av. {cure}") from error
    pieces, count = list[Floats](), 0
    with av.open(io.BytesIO(content), "r", format=_find_demuxer(content[:12])) as container:
        if not container.streams.audio:
            raise DataError(f"{name}: no sound track. Choose a recording with sound.")
        stream, resampler = container.streams.audio[0], av.AudioResampler(format="fltp")
        for frame in container.decode(stream):
            pieces += [piece.to_ndarray().astype(np.float64) for piece in resampler.resample(frame)]
            count += frame.samples
            if count > max_seconds * stream.rate:
                break
        return float(stream.rate), np.concatenate(pieces, axis=1)


def _is_wav(head: bytes) -> bool:
    return head[:4] in (b"RIFF", b"RIFX", b"RF64") and head[8:12] == b"WAVE"


def _wav_sample_tag(content: bytes) -> int:
    """Return the format tag of a WAV file; -1 without one."""
    at = content.find(b"fmt ") + 8
    return int.from_bytes(content[at : at + 2], "big" if content[:4] == b"RIFX" else "little") if at >= 8 else -1


def _find_demuxer(head: bytes) -> str:
    """Return the container of PyAV by its signature (M4A, MP4, 3GP; WebM); empty for a format of soundfile."""
    if head[4:8] == b"ftyp":
        return "mp4"
    return "matroska" if head[:4] == b"\x1aE\xdf\xa3" else ""


def _has_signature(head: bytes) -> bool:
    is_frame = int.from_bytes(head[:2], "big") & MP3_SYNC_BITS == MP3_SYNC_BITS and head[1] & 0x06 == 0x02
    has_magic = _is_wav(head) or head[:4] in (b"fLaC", b"OggS") or head[:3] == b"ID3"
    return has_magic or is_frame or bool(_find_demuxer(head))


def _is_audio(head: bytes, path: Path) -> bool:
    """Return whether a file begins or is named like a sound file."""
    return _has_signature(head) or path.suffix.lower() in AUDIO_FORMAT.extensions


AUDIO_FORMAT = Format(
    "wav",
    "WAV, FLAC, MP3, OGG, M4A or WebM file",
    (".wav", ".flac", ".mp3", ".ogg", ".m4a", ".webm"),
    _is_audio,
    read_audio,
)
