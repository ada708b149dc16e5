"""Mass check around a tap test: an emulated mass, the line of the self-check, and the offer after a test."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from acquisition import Channel, DeviceIdentity, HammeredStructure, TapsSource, find_driver
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.measurement.chain_check import ChainCheck, ChainEvidence
from lobewatch.show import mass_check_offer
from lobewatch.tap.device_connection import DeviceConnection
from lobewatch.tap.emulated_mass import build_hung_mass, emulate_mass
from lobewatch.tap.emulated_spindle import EMULATED_CHANNELS, emulate_machine
from lobewatch.tap.mass_check import check_mass_entry, measure_mass, store_emulator_check, store_mass_result

BOARD = DeviceIdentity("board", "1234")


@pytest.mark.parametrize("mass", [0.5, 3.0])
def test_an_emulated_mass_is_what_it_is(simulated: Any, folder: MachineFolder, mass: float) -> None:
    device = simulated(HammeredStructure(build_hung_mass(mass), 25600.0, np.random.default_rng(1)), EMULATED_CHANNELS)
    device.identity = BOARD
    result = measure_mass(folder, device, mass, lambda _: None)
    assert result.ratio == pytest.approx(1.0, abs=4 * result.ratio_std)
    assert result.ratio_std < 0.01
    stored = store_mass_result(folder, device, result)
    assert stored is not None
    assert (stored.passed, stored.chain.daq) == (True, "1234")


@pytest.mark.parametrize("mass", [0.0, -1.0, float("nan")])
def test_a_mass_that_is_none_is_refused(folder: MachineFolder, mass: float) -> None:
    with pytest.raises(ValueError, match="emulate_mass"):
        emulate_mass(folder, find_driver("taps"), mass)


def test_the_self_check_names_the_mass_check_of_the_connected_device(simulated: Any, folder: MachineFolder) -> None:
    def line(channels: tuple[Channel, ...], identity: DeviceIdentity = BOARD) -> tuple[bool, bool] | None:
        device = simulated(lambda _, n: np.zeros((2, n)), channels)
        device.identity = identity
        found = check_mass_entry(folder, DeviceConnection(device))
        return None if found is None else (found.passed, found.is_notable)

    force, acceleration = EMULATED_CHANNELS
    emulator = DeviceIdentity("emulator", "EMULATED")
    assert line(EMULATED_CHANNELS) == line(EMULATED_CHANNELS, emulator) == (True, True)
    store_emulator_check(folder, EMULATED_CHANNELS)
    assert line(EMULATED_CHANNELS) == (True, True)
    assert line(EMULATED_CHANNELS, emulator) == (True, False)
    assert line((force, replace(acceleration, sensitivity=3.06e-3)), emulator) == (True, True)


def test_an_emulated_machine_brings_its_check_and_tells_the_host(folder: MachineFolder) -> None:
    with emulate_machine(folder, find_driver("taps"), realtime=False).device as device:
        with TapsSource(device.port) as source:
            assert source.identity.knows_sensors
        (stored,) = folder.contents().mass_checks
    assert (stored.mass_kg, stored.passed, stored.chain.daq) == (None, True, "EMULATED")


@pytest.mark.parametrize(
    ("answers", "checked"), [(["", "9"], []), (["x", "-1", "1,2"], [1.2]), ([], []), (["1.052"], [1.052])]
)
def test_a_person_is_offered_the_check_once_nothing_has_checked_the_sensors(
    monkeypatch: pytest.MonkeyPatch, simulated: Any, folder: MachineFolder, answers: list[str], checked: list[float]
) -> None:
    masses, left = list[float](), iter(answers)

    def check_mass(*arguments: Any) -> Any:
        masses.append(arguments[3])
        raise KeyboardInterrupt

    def answer() -> str:
        for text in left:
            return text
        raise EOFError

    check = ChainCheck("t")
    monkeypatch.setattr(Logbook, "chain_check", lambda *_: check)
    monkeypatch.setattr("builtins.input", answer)
    monkeypatch.setattr(mass_check_offer, "check_mass", check_mass)
    monkeypatch.setattr(
        mass_check_offer, "open_device", lambda *_: simulated(lambda _, n: np.zeros((2, n)), EMULATED_CHANNELS)
    )
    try:
        mass_check_offer.offer_mass_check(folder, "t", "port", "Kim")
    except KeyboardInterrupt:
        assert checked
    assert masses == checked
    check = ChainCheck("t", ChainEvidence.MODEL)
    mass_check_offer.offer_mass_check(folder, "t", "port", "Kim")
    assert masses == checked
