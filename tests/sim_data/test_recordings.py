"""Recordings of sim_data/: what they hold, and that the script makes them again."""

from __future__ import annotations

import wave
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import welch

import sim_data
from acquisition import Description, HitFlags, read_frf, read_tap
from lobewatch.logbook.heard_cuts import CutFileRequest, hear_file
from modal import fit_modes
from sim_data.make_data import FULL_SCALE, SPEED_RPM, TEETH, write_cuts, write_tap_test

FOLDER = Path(sim_data.__file__).parent


@pytest.mark.parametrize(("name", "frequency"), [("good-1722", 1722.0), ("worn-1550", 1550.0)])
def test_tap_tests_have_ten_good_hits_and_their_frequency(name: str, frequency: float) -> None:
    tap = read_tap(FOLDER / f"tap-{name}-hz.h5")
    assert (len(tap.hits), set(tap.flags)) == (10, {HitFlags.OK})
    first = fit_modes(tap.required_frf, (1200.0, 2200.0))[0]
    assert first.frequency == pytest.approx(frequency, abs=0.1)
    assert first.damping_ratio == pytest.approx(0.029, rel=0.01)
    for suffix in (".uff", ".csv"):
        frf = read_frf(FOLDER / f"tap-{name}-hz{suffix}")
        assert frf.receptance[1:] == pytest.approx(tap.required_frf.receptance[1:], rel=1e-5)


def read_sound(path: Path) -> tuple[np.typing.NDArray[np.float64], int]:
    with wave.open(str(path)) as file:
        return np.frombuffer(file.readframes(file.getnframes()), "<i2") / 32767 * FULL_SCALE, file.getframerate()


@pytest.mark.parametrize(("name", "is_chatter"), [("stable", False), ("chatter", True)])
def test_chatter_is_loud_between_the_multiples_of_the_spindle_frequency(name: str, is_chatter: bool) -> None:
    sound, rate = read_sound(FOLDER / f"cut-{name}.wav")
    cutting = sound[round(1.2 * rate) : round(1.9 * rate)]
    frequency, power = welch(cutting, rate, nperseg=4096)
    turns = frequency / (SPEED_RPM / 60)
    is_between = (np.abs(turns - np.round(turns)) > 0.1) & (frequency > TEETH * SPEED_RPM / 60)
    assert bool(power[is_between].max() > 0.1 * power[~is_between].max()) is is_chatter


@pytest.mark.parametrize(("name", "verdict"), [("stable", "stable"), ("chatter", "chatter")])
def test_listen_gives_the_verdict_of_each_cut(name: str, verdict: str) -> None:
    request = CutFileRequest(teeth=TEETH, speed_rpm=SPEED_RPM)
    (comparison,), _ = hear_file(FOLDER / f"cut-{name}.wav", Description(), request)
    assert comparison.detected.verdict == verdict
    assert np.max(np.abs(read_sound(FOLDER / f"cut-{name}.wav")[0])) < FULL_SCALE


def test_the_script_makes_the_same_recordings(tmp_path: Path) -> None:
    write_tap_test(tmp_path, "worn")
    write_cuts(tmp_path)
    again, kept = (read_tap(folder / "tap-worn-1550-hz.h5") for folder in (tmp_path, FOLDER))
    assert again.required_frf.receptance == pytest.approx(kept.required_frf.receptance, rel=1e-6)
    for name in ("cut-stable.wav", "cut-chatter.wav"):
        assert read_sound(tmp_path / name)[0] == pytest.approx(read_sound(FOLDER / name)[0], abs=0.01 * FULL_SCALE)
