"""Complete tap test on a board that prints lines, through a pseudo-terminal."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import STANDARD_GRAVITY, HammeredStructure, Hammering, MeasuredRate, Structure
from acquisition.emulation import SignalFunction
from acquisition.text_boards.source import TextBoardEmulator
from lobewatch.cli import main
from lobewatch.machine.daq_rates import apply_measured_rate
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.tap.device_connection import open_device

RATE = 10_000.0
FORCE, ACCELERATION = "sensitivity_mv_per_n = 2.25\nrange_v = 5", "sensitivity_mv_per_g = 10\nrange_v = 5"
DIGITAL = "sensitivity_mv_per_g = 100\nrange_v = 1.6"


def daq(sample_rate: int, *sensors: str, more: str = "") -> str:
    """Return [daq] of a board that prints these sensors in this order. more: further keys."""
    channels = (
        f'[[daq.channel]]\ninput = {i}\nquantity = "{"force" if "per_n" in sensor else "acceleration"}"\n{sensor}\n'
        for i, sensor in enumerate(sensors)
    )
    return "\n".join([f'[daq]\ndriver = "lines"\nsample_rate_hz = {sample_rate}\n{more}', *channels])


TWO_SENSORS = daq(10_000, FORCE, ACCELERATION, more="anti_alias = true\n") + "\n[daq.printing]\nbaud_rate = 921600\n"
ALONE, ADXL345 = daq(10_000, ACCELERATION), daq(3200, DIGITAL)
THREE_AXES = daq(3200, f'{DIGITAL}\ndirection = "x"', f'{DIGITAL}\ndirection = "y"', DIGITAL)
PER_N, PER_ACCELERATION = 2.25e-3, 10e-3 / 9.80665


@pytest.mark.parametrize("force", [True, False], ids=["force too", "acceleration alone"])
def test_a_whole_tap_test(
    force: bool,
    structure: Structure,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    make_machine_folder(Path("trial"), "new_machine.toml")
    toml = Path("trial/machine.toml")
    text = toml.read_text("utf-8").replace("[daq]\n", TWO_SENSORS if force else ALONE, 1)
    toml.write_text(text if force else text.replace("[tap]\n", '[tap]\nhammer = "none"\n'), "utf-8")
    folder = MachineFolder("trial")
    hammered = HammeredStructure(structure, RATE, np.random.default_rng(1), Hammering())
    signal: SignalFunction = hammered if force else lambda first, count: hammered(first, count)[1:]
    sensitivities = (PER_N, PER_ACCELERATION) if force else (PER_ACCELERATION,)
    with TextBoardEmulator(signal, sensitivities, 5.0, RATE, realtime=False) as board:
        with open_device(folder.machine.daq, board.port) as device:
            apply_measured_rate(folder, device, MeasuredRate(RATE, 1.0, 50_000, 5.0))
        monkeypatch.setattr(
            sys, "argv", ["lobewatch", "tap", "trial", "--direction", "x", "--port", board.port, "--json"]
        )
        with pytest.raises(SystemExit) as end:
            main()
    printed = capsys.readouterr()
    assert (end.value.code or 0) == 0, printed.err
    followed = json.loads(printed.out)["followed"]
    assert followed["frequency_hz"] == pytest.approx(1722.0, abs=max(0.5, 4 * followed["frequency_hz_std"]))
    assert (followed["stiffness_n_per_m"] is not None) == force
    (entry,) = folder.taps()
    assert "loss detection" in folder.read(entry).circumstances.device


def test_a_digital_sensor_of_five_dollars(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Use the z-axis of an ADXL345 by its data sheet: 430 ug per root Hz up to 1600 Hz, steps of 7.8 mg, gravity."""
    monkeypatch.chdir(tmp_path)
    make_machine_folder(Path("trial"), "new_machine.toml")
    toml, rate, step = Path("trial/machine.toml"), 3200.0, 7.8e-3 * STANDARD_GRAVITY
    text = toml.read_text("utf-8").replace("[daq]\n", ADXL345, 1)
    toml.write_text(text.replace("[tap]\n", '[tap]\nhammer = "none"\nrecord_s = 0.25\n'), "utf-8")
    truth = Structure(np.array([500.0]), np.array([0.03]), np.array([2e7]))
    hitting = Hammering((20.0, 80.0), response_noise=430e-6 * STANDARD_GRAVITY * 40)
    hammered = HammeredStructure(truth, rate, np.random.default_rng(2), hitting)

    def signal(first: int, count: int) -> NDArray[np.float64]:
        return np.asarray(np.round((hammered(first, count)[1:] + STANDARD_GRAVITY) / step) * step)

    folder = MachineFolder("trial")
    with TextBoardEmulator(signal, (0.1 / STANDARD_GRAVITY,), 1.6, rate, realtime=False) as board:
        with open_device(folder.machine.daq, board.port) as device:
            apply_measured_rate(folder, device, MeasuredRate(rate, 1.0, 16_000, 5.0))
        monkeypatch.setattr(sys, "argv", ["lobewatch", "tap", "trial", "--port", board.port, "--json"])
        with pytest.raises(SystemExit) as end:
            main()
    printed = capsys.readouterr()
    assert (end.value.code or 0) == 0, printed.err
    heard = re.search(r"1280 Hz\D* (\S+) m/s\^2 rms", printed.err)
    assert heard is not None, printed.err
    assert float(heard[1]) == pytest.approx(0.17, rel=0.2)  # which second is at rest, the clock decides
    followed = json.loads(printed.out)["followed"]
    error = followed["frequency_hz_std"]
    assert followed["frequency_hz"] == pytest.approx(500.0, abs=4 * error)  # 99.7 % of ten hits: nor are these the same
    assert 0.02 < error < 0.2


@pytest.mark.parametrize(("direction", "frequency"), [("x", 500.0), ("y", 430.0)])
def test_of_three_axes_that_of_the_direction_is_read(
    direction: str,
    frequency: float,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    make_machine_folder(Path("trial"), "new_machine.toml")
    toml, rate = Path("trial/machine.toml"), 3200.0
    text = toml.read_text("utf-8").replace("[daq]\n", THREE_AXES, 1)
    toml.write_text(text.replace("[tap]\n", '[tap]\nhammer = "none"\n'), "utf-8")
    hitting = Hammering((20.0, 80.0), double_hits=0.0, overloads=0.0, response_noise=0.2)
    modes = [Structure(np.array([f]), np.array([0.03]), np.array([2e7])) for f in (500.0, 430.0, 300.0)]
    axes = [HammeredStructure(mode, rate, np.random.default_rng(1), hitting) for mode in modes]

    def signal(first: int, count: int) -> NDArray[np.float64]:
        return np.stack([axis(first, count)[1] for axis in axes])

    folder = MachineFolder("trial")
    with TextBoardEmulator(signal, (0.1 / STANDARD_GRAVITY,) * 3, 1.6, rate, realtime=False) as board:
        with open_device(folder.machine.daq, board.port) as device:
            apply_measured_rate(folder, device, MeasuredRate(rate, 1.0, 16_000, 5.0))
        words = ["lobewatch", "tap", "trial", "--port", board.port, "--direction", direction, "--json"]
        monkeypatch.setattr(sys, "argv", words)
        with pytest.raises(SystemExit) as end:
            main()
    printed = capsys.readouterr()
    assert (end.value.code or 0) == 0, printed.err
    followed = json.loads(printed.out)["followed"]
    assert followed["frequency_hz"] == pytest.approx(frequency, abs=4 * followed["frequency_hz_std"])
    (entry,) = folder.taps()
    channels = folder.read(entry).hits[0].channels
    assert channels is not None
    assert [channel.direction for channel in channels] == [direction]
