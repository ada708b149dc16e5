"""Emulated devices identify themselves, and need a confirmation in a machine with real tap tests."""

from __future__ import annotations

import subprocess
import sys
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition import Circumstances, DataError, DeviceIdentity, TapTest, find_driver, new_tap_id, probe_port
from acquisition.channel import Channel, SensorInput
from acquisition.devices.drivers import DeviceSettings
from acquisition.emulation import EmulationSetup
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.measurement.recording_questions import find_device_questions
from lobewatch.tap.device_connection import describe_device, label_device
from lobewatch.tap.emulated_spindle import build_structure, get_spindle_table
from lobewatch.tap.session import TapSession, plan_session
from tests.lobewatch.tapped_emulator import make_emulator

Shop = Any
"""Machine fixture of tests/lobewatch/conftest.py."""
CODE = "emulated-device"
INPUTS = (
    SensorInput(0, Channel("force", sensitivity=2.25e-3, full_scale=5.0)),
    SensorInput(1, Channel("acceleration", sensitivity=1.02e-3, full_scale=5.0)),
)


@pytest.mark.parametrize("name", ["taps", "dataq", "lines"])
def test_each_emulator_says_that_it_is_one(name: str) -> None:
    driver = find_driver(name)
    assert driver.emulate is not None
    setup = EmulationSetup(lambda _rate: lambda _first, count: np.zeros((2, count)), INPUTS, 25600.0)
    with driver.emulate(setup) as emulated:
        answer = probe_port(emulated.port, (driver,))
        settings = DeviceSettings(inputs=INPUTS, sample_rate=None if name == "taps" else 10_000.0)
        with driver.open(emulated.port, settings) as device:
            assert device.identity.is_emulated
            assert label_device(device).endswith(", emulated device")
            about = Circumstances("m", datetime.now(UTC), device=describe_device(device))
    assert answer is not None
    assert answer.identity.is_emulated
    assert about.is_emulated


@pytest.mark.parametrize("serial", ["5E0ABC12", "", "QEMU-1", "EMU-11"])
def test_a_device_with_another_serial_number_is_real(serial: str) -> None:
    assert not DeviceIdentity("DI-4108", serial, "1.35").is_emulated
    assert not Circumstances("m", datetime.now(UTC), device=f"DI-4108, serial number {serial}").is_emulated


def tap(folder: MachineFolder, *accept: str) -> TapSession:
    """Run a tap test with the emulated TAPS/1 device."""
    table = get_spindle_table(folder)
    structure = build_structure(table.build(), table.damping_ratio)
    with make_emulator(structure, np.random.default_rng(1), realtime=False) as device:
        session = plan_session(folder, port=device.port, accept=accept)
        session.run()
    return session


def test_among_emulated_tap_tests_nothing_is_asked(tmp_path: Path) -> None:
    folder = MachineFolder(make_machine_folder(tmp_path / "m", "surrogate_machine.toml").parent)
    for _ in range(2):
        assert "emulated device" in tap(folder).state.device
    assert [entry.asked for entry in folder.taps()] == [(), ()]


def test_among_real_tap_tests_it_is_asked_before_the_first_hit(shop: Shop) -> None:
    shop.tap(0, 1713.0)
    folder, before = shop.folder, sorted(shop.path.rglob("*.h5"))
    with pytest.raises(DataError, match=rf"accept_questions\.codes {CODE}"):
        tap(folder)
    assert sorted(shop.path.rglob("*.h5")) == before
    session = tap(folder, CODE)
    assert session.unasked == []
    _, entry = folder.taps()
    assert (entry.asked, entry.accepted) == ((CODE,), (CODE,))
    assert folder.read(entry).circumstances.is_emulated
    assert Logbook(folder).questions.get(entry.id) is None


def test_a_damaged_old_tap_file_does_not_stop_the_question(shop: Shop) -> None:
    shop.tap(0, 1713.0)
    shop.tap(1, 1713.0)
    old, new = (shop.path / entry.file for entry in shop.folder.taps())
    about = DeviceIdentity("DI-4108", "EMULATED", "")
    old.write_bytes(old.read_bytes()[:-40] + bytes(40))
    assert find_device_questions(shop.folder, about) == (CODE,)
    new.unlink()
    assert find_device_questions(MachineFolder(shop.path), DeviceIdentity("DI-4108", "5E0ABC12", "")) == ()


def test_an_emulated_tap_test_that_is_committed_without_an_answer_is_no_reference(shop: Shop) -> None:
    shop.tap(0, 1713.0)
    stored = shop.folder.read(shop.folder.taps()[0])
    device = "lobewatch emulator, serial number EMU-1, firmware 1.0"
    about = Circumstances("m", datetime(2026, 3, 2, tzinfo=UTC), "reference", machine_toml="", device=device)
    logbook = shop.logbook
    logbook.commit(TapTest(new_tap_id(about), about, stored.frf))
    assert [*logbook.questions.values()] == [(CODE,)]


def test_a_machine_without_a_spindle_gets_the_example_spindle(tmp_path: Path) -> None:
    make_machine_folder(tmp_path / "m", "new_machine.toml")
    folder = MachineFolder(tmp_path / "m")
    assert folder.machine.spindle is None
    command = [sys.executable, "-m", "lobewatch", "emulate", "taps", str(folder.path), "--fast"]
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, text=True, **streams) as process:  # type: ignore[call-overload]
        with closing(process.stdout):
            port = process.stdout.readline().split()[1]
            session = plan_session(folder, port=port)
            session.run()
        process.terminate()
        notes = process.stderr.read()
    assert notes.count("[spindle]") == 1
    assert session.measurement.followed is not None
    assert session.measurement.followed.frequency == pytest.approx(1713.05, abs=0.5)
