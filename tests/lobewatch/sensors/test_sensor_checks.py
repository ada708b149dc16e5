"""lobewatch sensors against emulated devices: connected sensors, a hung mass, a common signal."""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import (
    Channel,
    DataqEmulator,
    DataqFaults,
    HammeredStructure,
    Hammering,
    MeasuredRate,
    Structure,
    TapsEmulator,
    TapsSource,
)
from acquisition.emulation.emulated_device import SignalFunction
from lobewatch.cli import main
from lobewatch.machine.daq_rates import apply_measured_rate
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.machine.journal.mass_checks import SensorChain
from lobewatch.sensors.sensor_checks import list_sensors

RATE = 25600.0
MASS = 1.2
FORCE = Channel("force", 2.25e-3, 5.0, calibration_date="2026-01-15")
ACCELERATION = Channel("acceleration", 1.02e-3, 5.0, calibration_date="2026-01-15")

DATAQ = """[daq]
driver = "dataq"
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
"""
Said = tuple[int, str, str]
Sensors = Callable[..., Said]


@pytest.fixture
def folder(tmp_path: Path) -> MachineFolder:
    """Make a machine tapped before, whose emulator is known at any speed."""
    make_machine_folder(tmp_path / "mill", "new_machine.toml")
    return MachineFolder(tmp_path / "mill")


@pytest.fixture
def sensors(folder: MachineFolder, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Sensors:
    """Run the command on an emulated device: exit code, stdout, stderr."""
    monkeypatch.setattr(sys.modules[list_sensors.__module__], "RATE_MEASUREMENT_SECONDS", 3.0)

    def run(
        signal: SignalFunction,
        channels: tuple[Channel, ...],
        *arguments: object,
        rate: float = RATE,
        realtime: bool = False,
    ) -> Said:
        with TapsEmulator(signal, channels, rate, realtime=realtime) as device:
            if not realtime:
                with TapsSource(device.port) as source:
                    apply_measured_rate(folder, source, MeasuredRate(rate, 0.1, 5, 5.0))
            monkeypatch.setattr(
                sys, "argv", ["lobewatch", "sensors", str(folder.path), "--port", device.port, *map(str, arguments)]
            )
            capsys.readouterr()
            with pytest.raises(SystemExit) as end:
                main()
        said = capsys.readouterr()
        return int(end.value.code or 0), said.out, said.err

    return run


def silence(first: int, n: int) -> NDArray[np.float64]:
    return np.zeros((2, n))


def hung_mass(mass: float) -> SignalFunction:
    """Somebody hits a free mass: accelerance 1/m above its pendulum of 1.2 Hz."""
    pendulum = Structure(np.array([1.2]), np.array([0.3]), np.array([mass * (2 * np.pi * 1.2) ** 2]))
    how = Hammering(interval_range=(0.3, 0.35), response_noise=0.2)
    return HammeredStructure(pendulum, RATE, np.random.default_rng(3), how)


class CommonNoise:
    """White noise on both inputs (V), the second sampled later by a skew (samples); periodic, so exact."""

    def __init__(self, skew: float, channels: tuple[Channel, Channel]) -> None:
        size, random = 1 << 16, np.random.default_rng(1)
        cycles = np.fft.rfftfreq(size)
        spectrum = np.where((cycles > 0) & (cycles < 0.4), random.normal(size=(2, cycles.size)).T @ [1, 1j], 0.0)
        volts = np.fft.irfft(np.stack([spectrum, spectrum * np.exp(2j * np.pi * cycles * skew)]), size)
        volts /= np.std(volts)
        self._signals = volts / np.array([[channel.sensitivity] for channel in channels])

    def __call__(self, first_scan: int, n_scans: int) -> NDArray[np.float64]:
        return np.take(self._signals, first_scan + np.arange(n_scans), axis=1, mode="wrap")


def test_the_list_names_channels_rate_and_uncertainties(sensors: Sensors, folder: MachineFolder) -> None:
    old = replace(FORCE, calibration_date="2020-01-15")
    absurd = replace(ACCELERATION, sensitivity=100.0, calibration_date="")
    code, out, err = sensors(silence, (old, absurd), rate=102400.0, realtime=True)
    assert code == 0, err
    assert re.search("lobewatch emulator.* EMU-1", out)
    assert re.search(r"0 +force +2\.25 mV/N +±2222 N +±5 V +16 +0 +- +2020-01-15", out)
    assert re.search(r"1 +acceleration +9\.807e\+05 mV/g +±0\.005099 g +±5 V +16 +0 +- +-", out)
    assert re.search(r"102400 Hz, .*102[34]\d\d(\.\d)? ± \d+", out)
    for facts in ("force: .*2020-01-15", "acceleration: .*100 V per m/s", "acceleration: .*calibration", "51200 Hz"):
        assert re.search(f"warning: .*{facts}", out)
    assert "102400.0" in (folder.path / "daq.json").read_text()


def test_the_interval_of_calibration_is_that_of_the_machine_file(sensors: Sensors, folder: MachineFolder) -> None:
    text = folder.toml.read_text("utf-8")
    keys = "[daq]\ncalibration_interval_months = 1200\nanti_alias = true"
    folder.toml.write_text(text.replace("[daq]", keys), "utf-8")
    old = replace(FORCE, calibration_date="2000-01-15")
    assert "warning" not in sensors(silence, (old, ACCELERATION), rate=102400.0, realtime=True)[1]


def test_a_date_in_the_future_is_an_error(sensors: Sensors) -> None:
    tomorrow = replace(FORCE, calibration_date="2999-01-15")
    code, out, _ = sensors(silence, (tomorrow, ACCELERATION), "--json")
    assert code == 2
    said = json.loads(out)
    assert [channel["quantity"] for channel in said["channels"]] == ["force", "acceleration"]
    assert said["channels"][0]["full_scale_si"] == pytest.approx(2222.2, abs=0.1)
    assert said["sample_rate_hz"] == RATE
    (error,) = said["errors"]
    assert (error["code"], error["about"]) == ("calibration-in-future", "force")
    assert "2999-01-15" in error["text"]
    assert error in said["remarks"]


def test_a_device_at_half_its_rate_is_rejected(
    folder: MachineFolder, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys.modules[list_sensors.__module__], "RATE_MEASUREMENT_SECONDS", 3.0)
    folder.toml.write_text(folder.toml.read_text("utf-8").replace("[daq]", DATAQ), "utf-8")
    inputs = tuple(table.build() for table in MachineFolder(folder.path).machine.daq.channel)
    with DataqEmulator(lambda _: silence, inputs, faults=DataqFaults(halved_rate=True)) as device:
        monkeypatch.setattr(sys, "argv", ["lobewatch", "sensors", str(folder.path), "--port", device.port])
        with pytest.raises(SystemExit) as end:
            main()
    assert end.value.code == 2
    assert re.search(r"error: .* 2[45]\d{3}\.\d+ ± .* 50000 ", capsys.readouterr().out)
    assert not (folder.path / "daq.json").exists()


def test_a_hung_mass_whose_sensitivities_are_right(sensors: Sensors) -> None:
    code, out, err = sensors(hung_mass(MASS), (FORCE, ACCELERATION), "--mass-kg", MASS)
    assert code == 0, err
    assert " 10 / 10  ✓ GOOD" in err
    assert "F/(m a) = 1.000" in out or "F/(m a) = 0.999" in out
    assert "5%" in out
    assert "sens_V_per_EU" not in out


def test_a_hung_mass_heavier_than_stated_shows_what_to_change(sensors: Sensors, folder: MachineFolder) -> None:
    """The wrong mass stands for a wrong sensitivity: F/(m a) cannot tell them apart, and the text says so."""
    code, out, err = sensors(hung_mass(1.1 * MASS), (FORCE, ACCELERATION), "--mass-kg", MASS)
    assert code == 0, err
    assert "force is 10.0%" in out
    assert re.search(r"2\.475 mV/N .*2\.25\b", out)
    factor = re.search(r"sens_V_per_EU of the force channel by (\S+),", out)
    assert factor is not None
    assert float(factor[1]) == pytest.approx(1.1, abs=2e-3)
    assert "total moving mass" in out
    (stored,) = folder.contents().mass_checks
    assert not stored.passed
    assert stored.ratio == pytest.approx(1.1, abs=2e-3)


def test_json_of_a_hung_mass(sensors: Sensors, folder: MachineFolder) -> None:
    _, out, _ = sensors(hung_mass(MASS), (FORCE, ACCELERATION), "--mass-kg", MASS, "--json")
    said = json.loads(out)
    assert said["ratio"] == pytest.approx(1, abs=4 * said["ratio_std"])
    assert said["hits"] == 10
    assert (said["agrees"], said["remarks"]) == (True, [])
    assert said["force_sensitivity_v_per_n"] == pytest.approx(2.25e-3, rel=2e-3)
    (stored,) = folder.contents().mass_checks
    assert (said["journal"], said["passed"]) == (stored.id, stored.passed) == ("m1", True)
    assert (stored.mass_kg, stored.ratio, stored.ratio_std) == (MASS, said["ratio"], said["ratio_std"])
    assert stored.chain == SensorChain("EMULATED", 2.25e-3, 1.02e-3, 5.0, 5.0)


@pytest.mark.parametrize("skew", [0.5, -0.25])
def test_the_skew_of_both_inputs(sensors: Sensors, skew: float) -> None:
    signal = CommonNoise(skew, (FORCE, ACCELERATION))
    code, out, err = sensors(signal, (FORCE, ACCELERATION), "--skew")
    assert code == 0, err
    assert f"({skew:.4f} samples)" in out
    assert "0.000 us" in out
    assert re.search(re.escape(f"skew_s = {skew / RATE:.3e}") + ".*INFO", out)
    said = json.loads(sensors(signal, (FORCE, ACCELERATION), "--skew", "--json")[1])
    assert said["skew_samples"] == pytest.approx(skew, abs=5e-5)
    assert said["skew_us"] == pytest.approx(1e6 * skew / RATE, abs=5 * said["skew_us_std"])


def test_two_different_signals_have_no_skew(sensors: Sensors) -> None:
    code, out, err = sensors(hung_mass(MASS), (FORCE, replace(ACCELERATION, sensitivity=1e-9)), "--skew")
    assert (code, out) == (2, "")
    assert "coherence" in err
    assert "T-piece" in err


def test_wrong_use(sensors: Sensors, folder: MachineFolder) -> None:
    code, _, err = sensors(silence, (FORCE, ACCELERATION), "--skew", "--mass-kg", 1)
    assert code == 2
    assert re.search("error: --mass-kg .*--skew", err)
    code, _, err = sensors(lambda _, n: np.zeros((1, n)), (ACCELERATION,), "--skew")
    assert (code, "[[daq.channel]]" in err) == (2, True)
    assert "mass=-1.0 kg" in sensors(hung_mass(MASS), (FORCE, ACCELERATION), "--mass-kg", -1)[2]


@pytest.mark.parametrize(("options", "used"), [((), 1.02e-3), (("--direction", "y"), 1.07e-3)])
def test_one_of_two_accelerometers_hangs_on_the_mass(
    sensors: Sensors, folder: MachineFolder, options: tuple[str, ...], used: float
) -> None:
    signal, row = hung_mass(MASS), 2 if options else 1

    def three(first: int, n: int) -> NDArray[np.float64]:
        values = np.random.default_rng(first).normal(scale=0.2, size=(3, n))
        values[[0, row]] = signal(first, n)
        return values

    x = replace(ACCELERATION, direction="x")
    y = replace(ACCELERATION, direction="y", sensitivity=1.07e-3)
    code, _, err = sensors(three, (FORCE, x, y), "--mass-kg", "1,2", *options)
    assert code == 0, err
    (check,) = folder.contents().mass_checks
    assert (check.mass_kg, check.passed) == (MASS, True)
    assert check.chain.acceleration_v_per_m_s2 == pytest.approx(used)


@pytest.mark.parametrize("mass", ["0", "nan", "inf", "1000", "0.01", "heavy"])
def test_a_mass_that_nobody_hangs_is_refused_before_the_hits(
    sensors: Sensors, folder: MachineFolder, mass: str
) -> None:
    code, out, err = sensors(hung_mass(MASS), (FORCE, ACCELERATION), "--mass-kg", mass)
    assert (code, out) == (2, "")
    assert "HIT" not in err
    assert folder.contents().mass_checks == ()
