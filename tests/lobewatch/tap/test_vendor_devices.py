"""Complete tap test through each device that a vendor library reads, with emulated libraries."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from functools import partialmethod
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from fake_libraries import Volts, Wiring, fake_daqhats, fake_ljm, fake_nidaqmx, fake_sounddevice, fake_uldaq

from acquisition import HammeredStructure, Hammering, MeasuredRate, Structure
from acquisition.vendor_drivers.library_device import LibraryDevice
from lobewatch.cli import main
from lobewatch.machine.daq_rates import apply_measured_rate
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.tap.device_connection import open_device

PORTS = {
    "audio": "audio:485B39",
    "nidaqmx": "nidaqmx:cDAQ1Mod1",
    "mcc172": "mcc172:0",
    "uldaq": "uldaq:01F2A3B4",
    "ljm": "ljm:470012345",
}


def libraries(wiring: Wiring) -> dict[str, ModuleType]:
    name = "485B39 201234508460000846000260115"
    return {
        "sounddevice": fake_sounddevice(wiring, (name,), 2**23 / 846000),
        **fake_nidaqmx(wiring, (25600.0, 51200.0)),
        "daqhats": fake_daqhats(wiring),
        "uldaq": fake_uldaq(wiring),
        **fake_ljm(wiring),
    }


def machine_with(driver: str) -> MachineFolder:
    """Make a machine with this driver in the working directory."""
    make_machine_folder(Path("trial"), "new_machine.toml")
    toml = Path("trial/machine.toml")
    range_v = 10 if driver in ("audio", "uldaq", "ljm") else 5
    channels = f"""[daq]
driver = "{driver}"
port = "{PORTS[driver]}"

[[daq.channel]]
input = 0
quantity = "force"
sensitivity_mv_per_n = 2.25
range_v = {range_v}

[[daq.channel]]
input = 1
quantity = "acceleration"
sensitivity_mv_per_g = 10
range_v = {range_v}

"""
    toml.write_text(toml.read_text("utf-8").replace("[daq]\n", channels, 1), "utf-8")
    return MachineFolder("trial")


def hammered(folder: MachineFolder, structure: Structure) -> Callable[[float], Callable[[int, int], Volts]]:
    """Return the sensor voltages of a tapped structure."""
    sensitivities = np.array([[sensor.channel.sensitivity] for sensor in folder.machine.daq.settings.inputs])

    def at(rate: float) -> Callable[[int, int], Volts]:
        signal = HammeredStructure(structure, rate, np.random.default_rng(1), Hammering())
        return lambda first, count: signal(first, count) * sensitivities

    return at


@pytest.mark.parametrize("driver", PORTS)
def test_a_whole_tap_test(
    driver: str,
    structure: Structure,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    folder = machine_with(driver)
    for name, module in libraries(Wiring(hammered(folder, structure))).items():
        monkeypatch.setitem(sys.modules, name, module)
    with open_device(folder.machine.daq, PORTS[driver]) as device:
        apply_measured_rate(folder, device, MeasuredRate(device.sample_rate, 1.0, 250_000, 5.0))
    as_read = partialmethod(LibraryDevice.__init__, follows_clock=False)  # a simulated library is as fast as it is read
    monkeypatch.setattr(LibraryDevice, "__init__", as_read)
    monkeypatch.setattr(sys, "argv", ["lobewatch", "tap", "trial", "--direction", "x", "--json"])
    with pytest.raises(SystemExit) as end:
        main()
    printed = capsys.readouterr()
    assert (end.value.code or 0) == 0, printed.err
    assert "10 / 10  ✓ GOOD" in printed.err
    followed = json.loads(printed.out)["followed"]
    assert followed["frequency_hz"] == pytest.approx(1722.0, abs=max(0.3, 4 * followed["frequency_hz_std"]))
    assert followed["stiffness_n_per_m"] == pytest.approx(3.2289e7, rel=0.01)
    (entry,) = folder.taps()
    assert device.identity.serial in folder.read(entry).circumstances.device
