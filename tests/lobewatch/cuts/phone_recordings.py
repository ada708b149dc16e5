"""Recordings that a phone brings: cuts, and much that is no usable cut. All are sound pressure over time, seeded."""

from __future__ import annotations

import io
from typing import Any, NamedTuple

import numpy as np
import scipy.signal

from acquisition.arrays import Floats
from acquisition.files.cut_file import CutSignal

RATE, TELEPHONE_RATE = 44100, 8000
"""Sample rate of a phone, and of a telephone (Hz)."""
TELEPHONE_BAND = (300.0, 3400.0)
"""Band of a telephone (Hz), ITU-T G.712."""


class PhoneCut(NamedTuple):
    """A recorded cut and its true values."""

    sound: Floats
    """Shares of the full scale, shape (n,)."""
    rpm: float
    """Spindle speed (rpm)."""
    teeth: int
    """Number of flutes."""
    chatter: float | None
    """Chatter frequency (Hz); None for a stable cut."""


def draw_cut(random: np.random.Generator, chatters: bool, rpm: float | None = None) -> PhoneCut:
    """Draw 1.2 s of air, 2.2 s of a cut of 2 to 4 flutes and 0.6 s of air at 3000 to 20 000 rpm."""
    speed = random.uniform(3000, 20_000) if rpm is None else rpm
    teeth, turn = int(random.integers(2, 5)), speed / 60
    time = np.arange(4 * RATE) / RATE
    lines = [(k * turn, (k / teeth) ** -0.8 if k % teeth == 0 else 0.1 / k**0.5) for k in range(1, int(9000 / turn))]
    frequency = None
    if chatters:
        frequency = (int(random.uniform(400, 2800) / turn) + random.uniform(0.2, 0.8)) * turn
        lines += [(frequency + k * teeth * turn, 1.5 * 0.35 ** abs(k)) for k in range(-3, 5)]
    inside = np.clip((time - 1.2) / 0.05, 0, 1) * np.clip((3.4 - time) / 0.05, 0, 1)
    sound = 0.03 * random.standard_normal(time.size) + 0.05 * np.sin(2 * np.pi * turn * time)
    for hz, height in lines:
        if hz > 50:
            sound += height * inside * np.cos(2 * np.pi * hz * time + random.uniform(0, 2 * np.pi))
    sound += 0.1 * inside * random.standard_normal(time.size)
    return PhoneCut(np.asarray(0.6 * sound / np.max(np.abs(sound))), speed, teeth, frequency)


def play_music(random: np.random.Generator, quiet: float) -> Floats:
    """Play six seconds of chords and drums after a quiet time (s)."""
    time = np.arange(6 * RATE) / RATE
    sound, beat, root = (
        0.002 * random.standard_normal(time.size),
        60 / random.uniform(80, 140),
        random.uniform(100, 220),
    )
    for start in np.arange(quiet, 6.0, beat / 2):
        for _ in range(random.integers(1, 4)):
            pitch = root * 2 ** ((random.choice([0, 2, 4, 5, 7, 9, 11]) + 12 * random.integers(0, 3)) / 12)
            on = (time > start) & (time < start + random.choice([0.5, 1, 2]) * beat)
            after = time[on] - start
            for k in range(1, 10):
                sound[on] += random.uniform(0.3, 1) / k * np.exp(-2 * after) * np.sin(2 * np.pi * k * pitch * after)
        drum = (time > start) & (time < start + 0.1)
        sound[drum] += np.exp(-40 * (time[drum] - start)) * random.standard_normal(np.count_nonzero(drum))
    return np.asarray(0.7 * sound / np.max(np.abs(sound)))


def telephone(sound: Floats) -> Floats:
    """Return a sound as a telephone passes it on, at `TELEPHONE_RATE`."""
    slow = scipy.signal.resample_poly(sound, 80, 441)
    band = scipy.signal.butter(6, TELEPHONE_BAND, "bandpass", fs=TELEPHONE_RATE, output="sos")
    return np.asarray(scipy.signal.sosfilt(band, slow))


def code_lossily(sound: Floats, codec: str, kbit: int) -> tuple[Floats, float]:
    """Return a sound after a real encoder (libmp3lame, aac or libopus) at a bit rate, and its sample rate (Hz)."""
    import av

    file, rate = io.BytesIO(), 48000 if codec == "libopus" else RATE
    with av.open(file, "w", format={"libmp3lame": "mp3", "aac": "mp4"}.get(codec, "webm")) as output:
        stream: Any = output.add_stream(codec, rate=rate)
        stream.bit_rate, stream.layout = 1000 * kbit, "mono"
        size = stream.codec_context.frame_size or None
        resampler = av.AudioResampler(format=stream.format, layout="mono", rate=rate, frame_size=size)
        frame = av.AudioFrame.from_ndarray(sound[np.newaxis].astype(np.float32), format="fltp", layout="mono")
        frame.sample_rate = RATE
        for part in [*resampler.resample(frame), *resampler.resample(None), None]:
            output.mux(stream.encode(part))
    file.seek(0)
    coded: Any
    with av.open(file, "r") as coded:
        plain = av.AudioResampler(format="fltp", layout="mono")
        parts = [piece.to_ndarray() for frame in coded.decode(audio=0) for piece in plain.resample(frame)]
    return np.clip(np.concatenate(parts, axis=1)[0].astype(np.float64), -1, 1), rate


def as_signal(sound: Floats, rate: float = RATE) -> CutSignal:
    """Return a sound as it is read from a file."""
    return CutSignal(sound, rate, sensor="microphone")
