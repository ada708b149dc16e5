"""Detectable band of an accelerometer, checked before a test without force."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from acquisition import STANDARD_GRAVITY, Hit
from lobewatch.machine import Machine
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.settings.machine_file import parse_machine_file
from lobewatch.machine.settings.setup_tables import ModeTable
from lobewatch.tap.self_check import TARGET_FREQUENCY_ERROR, check_detectable_band, min_decay_amplitude
from modal import fit_decays

ROOT = Path(__file__).parents[3]


def machine_of(folder: MachineFolder, tap: str = "") -> Machine:
    text = re.sub(r"^trigger_n .*\n", "", folder.toml.read_text("utf-8"), flags=re.MULTILINE)
    text = text.replace("[tap]\n", f'[tap]\nhammer = "none"\n{tap}\n')
    return parse_machine_file(text)


def at_rest(rate: float, noise: float = 0.1) -> Hit:
    return Hit(np.empty(0), np.random.default_rng(1).normal(scale=noise, size=4000), rate)


@pytest.mark.parametrize("rate", [3200.0, 4000.0])
def test_a_slow_sensor_does_not_hear_the_mode_of_the_model(rate: float, folder: MachineFolder) -> None:
    check = check_detectable_band(at_rest(rate), machine_of(folder), "reference")
    assert not check.passed
    assert all(fact in check.text for fact in (f"{0.4 * rate:.0f} Hz", "1713 Hz", "model"))


def test_the_band_of_a_data_sheet_counts_before_that_of_the_sample_rate(folder: MachineFolder) -> None:
    check = check_detectable_band(at_rest(25600.0), machine_of(folder, "sensor_band_hz = 1600"), "reference")
    assert not check.passed
    assert "1600 Hz" in check.text
    assert check_detectable_band(at_rest(25600.0), machine_of(folder, "sensor_band_hz = 2000"), "reference").passed


def test_without_a_model_the_band_that_is_followed_counts_and_without_both_that_is_reported(
    folder: MachineFolder,
) -> None:
    machine = machine_of(folder)
    band = check_detectable_band(at_rest(3200.0), machine, "no such tool")
    assert not band.passed
    assert all(fact in band.text for fact in ("2200 Hz", "[mode] band_hz"))
    nobody = check_detectable_band(at_rest(3200.0), replace(machine, mode=ModeTable()), "no such tool")
    assert nobody.passed
    assert re.findall(r"(\d+) Hz", nobody.text) == ["1280"]  # that of the sensor only


@pytest.mark.parametrize(
    ("density", "least"), [(290e-6, (1.1, 1.5, 2.3)), (430e-6, (1.7, 2.2, 3.4)), (22.5e-6, (0.089, 0.11, 0.18))]
)
def test_sensors_of_data_sheets_need_what_the_page_says(density: float, least: tuple[float, ...]) -> None:
    for frequency, amplitude in zip((300.0, 500.0, 1200.0), least, strict=True):
        assert min_decay_amplitude(frequency, 0.03, density * STANDARD_GRAVITY) == pytest.approx(amplitude, rel=0.05)
        assert f"{amplitude:g}" in (ROOT / "docs/without-force.md").read_text("utf-8")


def test_noise_that_a_filter_keeps_to_a_narrower_band_is_denser_there(folder: MachineFolder) -> None:
    needed = [
        float(re.findall(r"([\d.]+) m/s", check_detectable_band(at_rest(25600.0), machine, "reference").text)[-1])
        for machine in (machine_of(folder), machine_of(folder, "sensor_band_hz = 3200"))
    ]
    assert needed[1] / needed[0] == pytest.approx(2.0, rel=0.05)


def test_hits_of_the_amplitude_that_is_reported_give_that_error() -> None:
    rate, frequency, damping, noise = 3200.0, 500.0, 0.03, 0.5
    size, time = min_decay_amplitude(frequency, damping, noise / np.sqrt(rate / 2)), np.arange(512) / rate
    w, found = 2 * np.pi * frequency, []
    for seed in range(30):
        random = np.random.default_rng(seed)
        phases = random.uniform(0, 6, (10, 1))
        decays = size * np.exp(-damping * w * time) * np.cos(w * np.sqrt(1 - damping**2) * time + phases)
        modes = fit_decays(decays + random.normal(scale=noise, size=decays.shape), rate, (50.0, 1280.0))
        found.append(min((mode.frequency for mode in modes), key=lambda near: abs(near - frequency)))
    assert 0.4 * TARGET_FREQUENCY_ERROR < np.std(found) / frequency < 1.8 * TARGET_FREQUENCY_ERROR
