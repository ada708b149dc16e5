"""The accelerometer during a cut from files: units, rates, columns, and rejected files."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import scipy.io.wavfile

from acquisition import Channel, DataError, Description
from acquisition.files.cut_file import CutSignal, write_cut_signal
from acquisition.files.read_cut import read_cut_recording

WAVE = np.sin(np.arange(2000) * 0.3)


def table(path: Path, heading: str, scale: float = 1.0) -> Path:
    rows = (f"{i / 25600:.9f},{value * scale:.9f}" for i, value in enumerate(WAVE))
    path.write_text("\n".join([heading, *rows]) + "\n")
    return path


def test_a_table_in_g_is_read_in_si(tmp_path: Path) -> None:
    sound = read_cut_recording(table(tmp_path / "cut.csv", "time [s],acceleration [g]"))
    assert sound.sample_rate == pytest.approx(25600.0, rel=1e-6)
    assert np.allclose(sound.acceleration, WAVE * 9.80665, atol=1e-6)


def test_a_wav_file_needs_its_full_scale_and_unit(tmp_path: Path) -> None:
    path = tmp_path / "cut.wav"
    scipy.io.wavfile.write(path, 48000, (WAVE * 32000).astype(np.int16))
    with pytest.raises(DataError, match=r"Description\.full_scale"):
        read_cut_recording(path)
    sound = read_cut_recording(path, Description(full_scale=(500.0,), unit="m/s^2"))
    assert sound.sample_rate == 48000.0
    assert np.allclose(sound.acceleration, WAVE * 500 * 32000 / 32768, atol=0.02)


def axes_table(path: Path) -> Path:
    """Write a table of a three-axis sensor, with one more column that is not a response."""
    rows = (f"{i / 1650:.9f},{a:.6f},{2 * a:.6f},{-a:.6f},0.7" for i, a in enumerate(WAVE))
    path.write_text("\n".join(["Time (s),Accel X (m/s^2),Accel Y (m/s^2),Accel Z (g),CI Value", *rows]) + "\n")
    return path


def test_several_accelerations_are_all_detected_and_one_is_where_it_is_named(tmp_path: Path) -> None:
    path = axes_table(tmp_path / "cut.csv")
    sound = read_cut_recording(path)
    assert np.allclose(sound.acceleration, [WAVE, 2 * WAVE, -9.80665 * WAVE], atol=1e-4)
    assert sound.duration == pytest.approx(WAVE.size / 1650, rel=1e-6)
    assert sound.clipped.shape == WAVE.shape
    assert sound.slice_time(0.1, 0.2).acceleration.shape == (3, 165)
    assert np.allclose(read_cut_recording(path, Description(response=2)).acceleration, 2 * WAVE, atol=1e-5)


def test_several_accelerations_come_back_from_a_recording_of_ours(tmp_path: Path) -> None:
    signal = read_cut_recording(axes_table(tmp_path / "cut.csv"))
    write_cut_signal(tmp_path / "c1.h5", signal, {"id": "c1"})
    assert np.array_equal(read_cut_recording(tmp_path / "c1.h5").acceleration, signal.acceleration)


def test_a_column_is_named_as_its_heading_is_in_the_file(tmp_path: Path) -> None:
    said = Description(columns=("time=Time (s)", "acceleration=Accel Y (m/s^2)"))
    assert np.allclose(read_cut_recording(axes_table(tmp_path / "cut.csv"), said).acceleration, 2 * WAVE, atol=1e-5)


HEARD = Description(sensor="microphone")


@pytest.mark.parametrize("name", ["cut.wav", "cut.flac", "cut.mp3"])
def test_a_microphone_needs_neither_unit_nor_full_scale(tmp_path: Path, name: str) -> None:
    soundfile = pytest.importorskip("soundfile")
    wave = 0.5 * np.sin(2 * np.pi * 440 * np.arange(48000) / 48000)
    soundfile.write(tmp_path / name, np.stack([wave, 0.5 * wave], axis=1), 48000)
    sound = read_cut_recording(tmp_path / name, HEARD)
    assert (sound.sample_rate, sound.sensor, sound.acceleration.shape[0]) == (48000.0, "microphone", 2)
    power = np.abs(np.fft.rfft(sound.acceleration[0])) ** 2
    assert np.argmax(power) * 48000 / sound.acceleration.shape[1] == pytest.approx(440, abs=1)
    assert np.std(sound.acceleration[0]) == pytest.approx(0.5 / np.sqrt(2), rel=0.03)
    write_cut_signal(tmp_path / "c1.h5", sound, {"id": "c1"})
    assert read_cut_recording(tmp_path / "c1.h5").sensor == "microphone"


@pytest.mark.parametrize("head", [b"fLaC" + bytes(60), b"ID3" + bytes(60), b"\xff\xfb\x90\x44" + bytes(60)])
def test_a_damaged_flac_or_mp3_is_rejected_and_so_it_is_without_soundfile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, head: bytes
) -> None:
    path = tmp_path / "cut.bin"
    path.write_bytes(head)
    with pytest.raises(DataError, match=r"cut\.bin: (damaged|.*soundfile)"):
        read_cut_recording(path, HEARD)
    monkeypatch.setitem(sys.modules, "soundfile", None)
    with pytest.raises(DataError, match=r"lobewatch\[sound\]"):
        read_cut_recording(path, HEARD)


def test_an_accelerometer_is_no_microphone(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"acceleration .*Description\.sensor microphone"):
        read_cut_recording(table(tmp_path / "cut.csv", "time [s],acceleration [g]"), HEARD)


def test_a_unit_that_the_file_does_not_say_is_asked_for(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"Description\.unit"):
        read_cut_recording(table(tmp_path / "cut.csv", "time [s],acceleration"))


def test_a_recording_of_ours_comes_back_with_its_codes(tmp_path: Path) -> None:
    channel, codes = Channel("acceleration", 0.01, 5.0), (WAVE * 20000).astype(np.int32)
    signal = CutSignal(np.asarray(codes * channel.scale, np.float64), 51200.0, codes, channel)
    write_cut_signal(tmp_path / "c1.h5", signal, {"id": "c1"})
    sound = read_cut_recording(tmp_path / "c1.h5")
    assert np.array_equal(sound.acceleration, signal.acceleration)
    assert not np.any(sound.clipped)


@pytest.mark.parametrize(("name", "content"), [("a.csv", b"x"), ("b.h5", b"\x89HDF\r\n\x1a\n"), ("c.bin", b"\x00\x01")])
def test_what_holds_no_acceleration_is_rejected_in_a_sentence(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(DataError, match=name):
        read_cut_recording(tmp_path / name)


def test_a_velocity_and_a_missing_file_are_rejected(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="velocity"):
        read_cut_recording(table(tmp_path / "cut.csv", "time [s],velocity [m/s]"))
    with pytest.raises(DataError, match="no such file"):
        read_cut_recording(tmp_path / "none.csv")


def test_a_signal_that_stands_at_its_rail_is_clipped_with_and_without_codes() -> None:
    channel = Channel("acceleration", 0.01, 5.0)
    codes = channel.encode(WAVE * 600.0)
    assert np.any(CutSignal(np.asarray(codes * channel.scale, np.float64), 25600.0, codes, channel).clipped)
    flat = np.clip(WAVE, -0.8, 0.8)
    clipped = CutSignal(flat, 25600.0).clipped
    assert np.array_equal(clipped, np.abs(flat) == 0.8) or np.mean(clipped) > 0.3
    assert not np.any(CutSignal(WAVE, 25600.0).clipped)


SPEED = np.where(np.arange(WAVE.size) % 128 < 30, 5.0, 0.0)
"""A pulse a turn at 12 000 rpm and 25.6 kHz."""


def turning(path: Path, heading: str, values: np.ndarray) -> Path:
    rows = (f"{i / 25600:.9f},{a:.6f},{v:g}" for i, (a, v) in enumerate(zip(WAVE, values, strict=True)))
    path.write_text("\n".join([f"time [s],acceleration [m/s^2],{heading}", *rows]) + "\n")
    return path


@pytest.mark.parametrize("heading", ["spindle [rpm]", "speed [1/min]", "n (U/min)", "speed_rpm"])
def test_a_column_in_turns_a_minute_is_the_speed(tmp_path: Path, heading: str) -> None:
    sound = read_cut_recording(
        turning(tmp_path / "cut.csv", heading, np.where(np.arange(WAVE.size) < 100, 0.0, -5990.0))
    )
    assert sound.acceleration.shape == WAVE.shape
    assert sound.speed_rpm is not None
    assert np.all(np.isnan(sound.speed_rpm[:100]))
    assert np.allclose(sound.speed_rpm[100:], 5990.0)
    part = sound.slice_time(0.01, 0.02).speed_rpm
    assert part is not None
    assert part.shape == (256,)


def test_pulses_and_turns_a_second_are_reported_by_the_unit(tmp_path: Path) -> None:
    pulses = turning(tmp_path / "tacho.csv", "Tacho [V]", SPEED)
    for said in (Description(), Description(tacho="3"), Description(tacho="Tacho", pulses=1)):
        speed = read_cut_recording(pulses, said).speed_rpm
        assert speed is not None
        assert np.nanmean(speed) == pytest.approx(12_000.0)
    halved = read_cut_recording(pulses, Description(pulses=2)).speed_rpm
    assert halved is not None
    assert np.nanmean(halved) == pytest.approx(6000.0)
    turns = read_cut_recording(
        turning(tmp_path / "hz.csv", "channel 4 [Hz]", 0 * WAVE + 100.0), Description(tacho="channel 4")
    )
    assert turns.speed_rpm is not None
    assert np.allclose(turns.speed_rpm, 6000.0)
    named = Description(columns=("time [s]", "acceleration [m/s^2]", "speed [rpm]"))
    speed = read_cut_recording(turning(tmp_path / "bare.csv", "x", 0 * WAVE + 5990.0), named).speed_rpm
    assert speed is not None
    assert np.allclose(speed, 5990.0)


def test_a_channel_of_a_sound_file_is_the_tachometer_and_needs_no_full_scale(tmp_path: Path) -> None:
    path = tmp_path / "cut.wav"
    scipy.io.wavfile.write(path, 25600, np.stack([WAVE * 32000, SPEED * 6000], axis=1).astype(np.int16))
    sound = read_cut_recording(path, Description(sensor="microphone", tacho="2"))
    assert sound.acceleration.shape == WAVE.shape
    assert sound.speed_rpm is not None
    assert np.nanmean(sound.speed_rpm) == pytest.approx(12_000.0)
    heard = read_cut_recording(path, Description(full_scale=(500.0,), unit="m/s^2", tacho="channel 2"))
    assert np.allclose(heard.acceleration, WAVE * 500 * 32000 / 32768, atol=0.02)
    write_cut_signal(tmp_path / "c1.h5", sound, {"id": "c1"})
    kept = read_cut_recording(tmp_path / "c1.h5").speed_rpm
    assert kept is not None
    assert np.array_equal(kept, sound.speed_rpm, equal_nan=True)


@pytest.mark.parametrize(
    ("heading", "values", "said", "text"),
    [
        ("Tacho [V]", 0 * WAVE + 4.9, Description(), "Tacho: 0 pulses in 0.0781 s"),
        (
            "Tacho [V]",
            WAVE,
            Description(tacho="4"),
            "'4'",
        ),
        ("n [rpm]", 0 * WAVE, Description(), " 0 rpm"),
        ("n [rpm]", 0 * WAVE + 6000, Description(pulses=2), "Description.pulses 2: n "),
        (
            "other",
            SPEED,
            Description(pulses=2),
            "Description.tacho",
        ),
        (
            "n",
            SPEED,
            Description(columns=("time [s]", "acceleration [m/s^2]", "speed")),
            "'n' (give Description.columns, for example \"speed [rpm]=n\")",
        ),
    ],
)
def test_a_tachometer_that_says_nothing_is_rejected(
    tmp_path: Path, heading: str, values: np.ndarray, said: Description, text: str
) -> None:
    with pytest.raises(DataError) as refused:
        read_cut_recording(turning(tmp_path / "cut.csv", heading, values), said)
    assert text in str(refused.value)
