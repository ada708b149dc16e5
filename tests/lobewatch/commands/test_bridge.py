"""lobewatch bridge: a DATAQ on this computer, tapped through TCP as a TAPS/1 device."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from acquisition import DataqEmulator, DataqFaults, HammeredStructure, Hammering
from lobewatch.cli import main
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.tap.emulated_spindle import build_structure
from lobewatch.tap.session import plan_session

SENSORS = """[daq]
driver = "dataq"

[[daq.channel]]
input = 0
quantity = "force"
sensitivity_mv_per_n = 2.25
range_v = 5
serial_number = "H-4711"
calibration_date = 2026-01-15

[[daq.channel]]
input = 1
quantity = "acceleration"
sensitivity_mv_per_g = 10
range_v = 10
serial_number = "A-0815"
calibration_date = 2026-01-15
"""


@pytest.fixture
def machines(tmp_path: Path) -> tuple[MachineFolder, MachineFolder]:
    """Make the folders of the computer with the DATAQ and of the other computer."""
    for name in ("pi", "office"):
        make_machine_folder(tmp_path / name, "surrogate_machine.toml")
    toml = tmp_path / "pi" / "machine.toml"
    begin, _, end = toml.read_text("utf-8").partition("[daq]\n")
    toml.write_text(begin + SENSORS + end[end.index("\n\n") :], "utf-8")
    return MachineFolder(tmp_path / "pi"), MachineFolder(tmp_path / "office")


def test_a_whole_tap_test_through_the_bridge(machines: tuple[MachineFolder, MachineFolder]) -> None:
    pi, office = machines
    spindle = office.machine.spindle
    assert spindle is not None
    structure = build_structure(spindle.build(), spindle.damping_ratio)

    def signal_at(rate: float) -> HammeredStructure:
        return HammeredStructure(structure, rate, np.random.default_rng(1), Hammering(double_hits=0.0, overloads=0.0))

    inputs = tuple(table.build() for table in pi.machine.daq.channel)
    with DataqEmulator(signal_at, inputs, faults=DataqFaults(drop_at=1_000_001)) as device:
        command = [
            sys.executable,
            "-m",
            "lobewatch.cli",
            "bridge",
            "dataq",
            str(pi.path),
            "--port",
            device.port,
            "--json",
        ]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as bridge:
            try:
                assert bridge.stdout is not None
                session = plan_session(office, port=json.loads(bridge.stdout.readline())["port"])
                tap = session.run()
            finally:
                bridge.terminate()
                _, err = bridge.communicate(timeout=100)
    assert (bridge.returncode, "Traceback" in err) == (130, False), err
    assert "DI-4108 on " in err
    assert tap.circumstances.device.startswith("DI-4108, serial number")
    channels = tap.hits[0].channels
    assert channels is not None
    force, response = channels
    assert (force.serial_number, response.serial_number, response.full_scale) == ("H-4711", "A-0815", 10.0)
    assert session.measurement.followed is not None
    assert session.measurement.followed.frequency == pytest.approx(structure.frequency[0], rel=1e-4)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["taps"], ["--port", "[daq]"]),
        (["taps", "{pi}", "--port", "x"], ["machine.toml", '"dataq"', '"taps"']),
        (["nothing", "--port", "x"], ["'nothing'", "taps, dataq"]),
        (
            ["dataq", "--port", "x"],
            ["a DATAQ DI-1120, 2108, 2108-P, 4108, 4208 or 4718B", "[[daq.channel]]"],
        ),
        (["taps", "--port", "/dev/ttyNOT"], ["/dev/ttyNOT"]),
    ],
)
def test_wrong_use(
    machines: tuple[MachineFolder, MachineFolder],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    told: list[str],
) -> None:
    monkeypatch.setattr(sys, "argv", ["lobewatch", "bridge", *(word.format(pi=machines[0].path) for word in words)])
    with pytest.raises(SystemExit) as end:
        main()
    err = capsys.readouterr().err
    assert (end.value.code, "Traceback" in err) == (2, False)
    assert [fact for fact in told if fact not in " ".join(err.split())] == []
