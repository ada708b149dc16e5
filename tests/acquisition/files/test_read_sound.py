"""The accelerometer during a cut from files: units, rates, columns, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import scipy.io.wavfile

from acquisition import Channel, DataError, Description
from acquisition.files.cut_file import CutSignal, write_cut_signal
from acquisition.files.read_sound import read_sound

WAVE = np.sin(np.arange(2000) * 0.3)


def table(path: Path, heading: str, scale: float = 1.0) -> Path:
    rows = (f"{i / 25600:.9f},{value * scale:.9f}" for i, value in enumerate(WAVE))
    path.write_text("\n".join([heading, *rows]) + "\n")
    return path


def test_a_table_in_g_is_read_in_si(tmp_path: Path) -> None:
    sound = read_sound(table(tmp_path / "cut.csv", "time [s],acceleration [g]"))
    assert sound.sample_rate == pytest.approx(25600.0, rel=1e-6)
    assert np.allclose(sound.acceleration, WAVE * 9.80665, atol=1e-6)


def test_a_wav_file_needs_its_full_scale_and_unit(tmp_path: Path) -> None:
    path = tmp_path / "cut.wav"
    scipy.io.wavfile.write(path, 48000, (WAVE * 32000).astype(np.int16))
    with pytest.raises(DataError, match="--full-scale"):
        read_sound(path)
    sound = read_sound(path, Description(full_scale=(500.0,), unit="m/s^2"))
    assert sound.sample_rate == 48000.0
    assert np.allclose(sound.acceleration, WAVE * 500 * 32000 / 32768, atol=0.02)


def test_a_unit_that_the_file_does_not_say_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="--unit"):
        read_sound(table(tmp_path / "cut.csv", "time [s],acceleration"))


def test_a_recording_of_ours_comes_back_with_its_codes(tmp_path: Path) -> None:
    channel, codes = Channel("acceleration", 0.01, 5.0), (WAVE * 20000).astype(np.int32)
    signal = CutSignal(np.asarray(codes * channel.scale, np.float64), 51200.0, codes, channel)
    write_cut_signal(tmp_path / "c1.h5", signal, {"id": "c1"})
    sound = read_sound(tmp_path / "c1.h5")
    assert np.array_equal(sound.acceleration, signal.acceleration)
    assert not np.any(sound.clipped)


@pytest.mark.parametrize(("name", "content"), [("a.csv", b"x"), ("b.h5", b"\x89HDF\r\n\x1a\n"), ("c.bin", b"\x00\x01")])
def test_what_holds_no_acceleration_is_refused_in_a_sentence(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DataError, match=name):
        read_sound(tmp_path / name)


def test_a_velocity_and_a_missing_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="velocity"):
        read_sound(table(tmp_path / "cut.csv", "time [s],velocity [m/s]"))
    with pytest.raises(DataError, match="no such file"):
        read_sound(tmp_path / "none.csv")


def test_a_signal_that_stands_at_its_rail_is_clipped_with_and_without_codes() -> None:
    channel = Channel("acceleration", 0.01, 5.0)
    codes = channel.encode(WAVE * 600.0)
    assert np.any(CutSignal(np.asarray(codes * channel.scale, np.float64), 25600.0, codes, channel).clipped)
    flat = np.clip(WAVE, -0.8, 0.8)
    clipped = CutSignal(flat, 25600.0).clipped
    assert np.array_equal(clipped, np.abs(flat) == 0.8) or np.mean(clipped) > 0.3
    assert not np.any(CutSignal(WAVE, 25600.0).clipped)
