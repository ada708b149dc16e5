"""A whole tap test on a board that prints lines, through a pseudo-terminal."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from acquisition import HammeredStructure, Hammering, MeasuredRate, Structure
from acquisition.lines import LinesEmulator
from lobewatch.cli import main
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.known_devices import use_rate
from lobewatch.machine.new_folder import make_machine_folder
from lobewatch.tap.plug import open_source

RATE = 10_000.0
DAQ = """[daq]
driver = "lines"
sample_rate_hz = 10000
anti_alias = true

[[daq.channel]]
input = 0
quantity = "force"
sensitivity_mv_per_n = 2.25
range_v = 5

[[daq.channel]]
input = 1
quantity = "acceleration"
sensitivity_mv_per_g = 10
range_v = 5

[daq.printing]
baud_rate = 921600
"""


def test_a_whole_tap_test(
    structure: Structure, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    make_machine_folder(Path("trial"), "new_machine.toml")
    toml = Path("trial/machine.toml")
    toml.write_text(toml.read_text("utf-8").replace("[daq]\n", DAQ, 1), "utf-8")
    folder = MachineFolder("trial")
    signal = HammeredStructure(structure, RATE, np.random.default_rng(1), Hammering())
    with LinesEmulator(signal, (2.25e-3, 10e-3 / 9.80665), 5.0, RATE, realtime=False) as board:
        with open_source(folder.machine.daq, board.port) as device:
            use_rate(folder, device, MeasuredRate(RATE, 1.0, 50_000, 5.0))
        monkeypatch.setattr(
            sys, "argv", ["lobewatch", "tap", "trial", "--direction", "x", "--port", board.port, "--json"]
        )
        with pytest.raises(SystemExit) as end:
            main()
    printed = capsys.readouterr()
    assert (end.value.code or 0) == 0, printed.err
    followed = json.loads(printed.out)["followed"]
    assert followed["frequency_hz"] == pytest.approx(1722.0, abs=max(0.5, 4 * followed["frequency_hz_std"]))
    (entry,) = folder.taps()
    assert "loss detection: broken lines" in folder.read(entry).circumstances.device
