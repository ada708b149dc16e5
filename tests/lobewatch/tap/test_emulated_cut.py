"""Emulated cut as received from the port: air, cut and chatter, and its hidden truth."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import DataError, TapsSource, find_driver
from acquisition.emulation import Passage
from lobes import Cut
from lobewatch.cli import main
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.machine.settings.requested_cut import find_cut_setting
from lobewatch.tap.emulated_cut import EmulatedCut, draw_hidden_truth, draw_runout, emulate_cut

RATE = 25600.0
PASSAGE = Passage(before=0.2, ramp=0.05, steady=0.5, after=0.1)
SHORT = Passage(before=0.0, ramp=0.0, steady=0.01, after=0.0)
PROGRAM = "A: slot at 12 600 rpm"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> MachineFolder:
    path: Path = tmp_path_factory.mktemp("cut") / "trial"
    make_machine_folder(path, "surrogate_machine.toml")
    return MachineFolder(path)


def emulated(folder: MachineFolder, depth_mm: float, speed_rpm: float | None = None, **options: Any) -> EmulatedCut:
    setting = find_cut_setting(folder.machine, PROGRAM, speed_rpm, depth_mm)
    return emulate_cut(folder, find_driver("taps"), setting, realtime=False, **{"passage": PASSAGE} | options)


def heard(cut: EmulatedCut, seconds: float) -> NDArray[np.float64]:
    """Return the acceleration (m/s^2) received from the port."""
    codes: list[NDArray[np.int32]] = []
    with cut.device as device, TapsSource(device.port) as source:
        source.start()
        for block in source.blocks():
            codes.append(block.codes)
            if sum(part.shape[1] for part in codes) >= seconds * RATE:
                break
        source.stop()
        assert [channel.quantity for channel in source.channels] == ["force", "acceleration"]
        scale = source.channels[1].scale
    return np.asarray(np.concatenate(codes, axis=1)[1, : round(seconds * RATE)] * scale, dtype=np.float64)


def share_off_comb(sound: NDArray[np.float64], speed_rpm: float) -> float:
    """Return the share of the cut's energy above 300 Hz that is off the harmonics of the spindle."""
    piece = sound[round(0.3 * RATE) : round(0.7 * RATE)]
    power = np.abs(np.fft.rfft(piece * np.hanning(piece.size))) ** 2
    frequency = np.fft.rfftfreq(piece.size, 1 / RATE)
    turns = frequency / (speed_rpm / 60)
    off = np.abs(turns - np.rint(turns)) * speed_rpm / 60 > 12
    return float(np.sum(power[off & (frequency > 300)]) / np.sum(power[frequency > 300]))


def test_below_the_limit_the_cut_turns_with_the_spindle_and_above_it_chatters(folder: MachineFolder) -> None:
    limit = 1e3 * emulated(folder, 1.0, 9000.0, passage=SHORT).limit
    shares = []
    for ratio in (0.6, 1.6):
        cut = emulated(folder, ratio * limit, 9000.0)
        assert 1e3 * cut.limit == pytest.approx(limit)
        sound = heard(cut, 0.8)
        shares.append(share_off_comb(sound, cut.speed_rpm))
        assert np.max(np.abs(sound)) < 0.9 * 5 / 1.02e-3  # the rails of the sensor
    assert shares[0] < 0.1
    assert shares[1] > 0.4


def test_before_the_cut_there_is_air_and_then_it_is_repeated(folder: MachineFolder) -> None:
    seconds = PASSAGE.before + PASSAGE.cutting + PASSAGE.after
    sound = heard(emulated(folder, 1.0), 2 * seconds)
    n = round(seconds * RATE)
    rms = [float(np.std(sound[round(a * RATE) : round(b * RATE)])) for a, b in ((0.02, 0.18), (0.3, 0.7), (0.98, 1.12))]
    assert rms[1] > 3 * max(rms[0], rms[2])
    cutting = slice(round(0.3 * RATE), round(0.7 * RATE))
    assert np.corrcoef(sound[cutting], sound[n - 1 :][cutting])[0, 1] > 0.9 or (
        np.corrcoef(sound[cutting], sound[n:][cutting])[0, 1] > 0.9
    )


def test_the_truth_is_that_of_the_seed_whatever_is_cut(folder: MachineFolder) -> None:
    one, other = emulated(folder, 1.0, passage=SHORT), emulated(folder, 2.0, 9000.0, passage=SHORT)
    assert one.truth == other.truth == draw_hidden_truth(1)
    assert emulated(folder, 1.0, seed=2, passage=SHORT).truth != one.truth
    assert one.speed_rpm / 12600 == pytest.approx(other.speed_rpm / 9000)
    assert 0 < abs(one.speed_rpm / 12600 - 1) <= 0.015


def test_truths_scatter_as_spindles_at_speed_may() -> None:
    truths = [draw_hidden_truth(seed).factors for seed in range(400)]
    middle = {name: float(np.mean([truth[name] for truth in truths])) for name in truths[0]}
    spread = {name: float(np.std([truth[name] for truth in truths])) / middle[name] for name in middle}
    for side in "xy":
        assert middle[f"frequency_{side}"] == pytest.approx(0.985, abs=0.004)
        assert spread[f"frequency_{side}"] == pytest.approx(0.02, rel=0.15)
        assert middle[f"damping_ratio_{side}"] == pytest.approx(1.1, abs=0.05)
        assert spread[f"stiffness_{side}"] == pytest.approx(0.1, rel=0.15)
    assert middle["tangential"] == pytest.approx(1.1, abs=0.06)
    assert spread["tangential"] == pytest.approx(0.3, rel=0.15)
    assert truths[0]["frequency_x"] != truths[0]["frequency_y"]


def test_an_eccentric_tool_has_teeth_on_a_circle() -> None:
    runout = np.array(draw_runout(Cut(4, 1.0, "down", 1e9, 3e8), np.random.default_rng(1)))
    assert np.max(np.abs(runout)) <= 20e-6
    assert runout[0] == pytest.approx(-runout[2])


def test_a_machine_without_a_model_is_rejected(folder: MachineFolder, tmp_path: Path) -> None:
    plain = tmp_path / "plain"
    plain.mkdir()
    text = folder.toml.read_text("utf-8")
    (plain / "machine.toml").write_text(text[: text.index("\n[spindle]")], "utf-8")


def test_a_driver_that_cannot_be_emulated_is_rejected(folder: MachineFolder) -> None:
    setting = find_cut_setting(folder.machine, PROGRAM, None, None)
    with pytest.raises(DataError, match=find_driver("taps").title):
        emulate_cut(folder, replace(find_driver("taps"), emulate=None), setting)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--speed", "9000"), "--cut PROGRAM"),
        (("--cut", "nobody's"), "nobody's"),
        (("--cut", PROGRAM, "--depth", "0"), "--depth 0"),
        (("--cut", "reference cut"), "--speed"),
    ],
)
def test_a_cut_that_cannot_be_is_rejected_by_the_command(
    folder: MachineFolder, options: tuple[str, ...], said: str, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    monkeypatch.setattr(sys, "argv", ["lobewatch", "emulate", "taps", str(folder.path), *options])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 2
    told = capsys.readouterr().err
    assert told.startswith("error: ")
    assert said in told
