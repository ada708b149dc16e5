"""lobewatch ports, emulate dataq and a tap test through an emulated DATAQ device, as a person meets them."""

from __future__ import annotations

import errno
import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import pytest
import serial

from acquisition import (
    DataError,
    DataqSource,
    DataqTraits,
    FileSource,
    MeasuredRate,
    PortInfo,
    TapsSource,
    explain_no_ports,
    find_driver,
    list_serial_ports,
    probe_port,
)
from acquisition.devices.drivers import BUILT_IN_DRIVERS
from acquisition.ports.serial_ports import explain_open_error
from acquisition.taps.protocol import Frame, MessageType, encode_frame
from lobewatch.cli import main
from lobewatch.machine.daq_rates import apply_measured_rate
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.tap.device_connection import open_device
from lobewatch.tap.emulated_spindle import emulate_machine

CHANNELS = """driver = "dataq"

[[daq.channel]]
input = 0
quantity = "force"
sensitivity_mv_per_n = 2.25
range_v = 2
serial_number = "H-4711"
calibration_date = 2026-01-15

[[daq.channel]]
input = 4
quantity = "acceleration"
sensitivity_mv_per_g = 10
range_v = 5
skew_us = 6.6666667

"""


class Said(NamedTuple):
    code: int
    out: str
    err: str


@pytest.fixture
def trial(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> MachineFolder:
    """Make the example machine with the sensors of a DATAQ device in the working directory."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("acquisition.dataq.protocol.DATAQ_STOP_SILENCE", 0.05)
    make_machine_folder(Path("trial"), "surrogate_machine.toml")
    toml = Path("trial/machine.toml")
    toml.write_text(toml.read_text("utf-8").replace("anti_alias = true ", CHANNELS + "# ", 1), "utf-8")
    return MachineFolder("trial")


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Any:
    """Run a command."""

    def command(*arguments: str) -> Said:
        monkeypatch.setattr(sys, "argv", ["lobewatch", *arguments])
        with pytest.raises(SystemExit) as end:
            main()
        said = capsys.readouterr()
        return Said(int(end.value.code or 0), said.out, said.err)

    return command


def dataq_device(folder: MachineFolder) -> Any:
    return emulate_machine(folder, find_driver("dataq"), realtime=False).device


def taps_device(folder: MachineFolder) -> Any:
    return emulate_machine(folder, find_driver("taps"), realtime=False).device


def test_a_tap_test_through_a_dataq_device_finds_the_emulated_spindle(run: Any, trial: MachineFolder) -> None:
    with dataq_device(trial) as device:
        with open_device(trial.machine.daq, device.port) as source:
            assert isinstance(source, DataqSource)
            apply_measured_rate(trial, source, MeasuredRate(source.sample_rate, 1.0, 250_000, 5.0))
        said = run("tap", "trial", "--port", device.port, "--details")
    assert said.code == 0, said.err
    assert "DI-4108, 50000 Hz, emulated device" in said.err
    assert "10 / 10  ✓ GOOD" in said.err
    assert " 1713." in said.out  # the skew of a third of a scan, left in, makes it 1715
    assert re.search(r" (1280\.|1279\.)", said.out)
    (entry,) = trial.taps()
    tap = trial.read(entry)
    assert tap.circumstances.device == "DI-4108, serial number EMULATED, firmware 1.35, loss detection: digital word"
    channels = tap.hits[0].channels
    assert channels is not None
    hammer, accelerometer = channels
    assert (hammer.serial_number, hammer.calibration_date) == ("H-4711", "2026-01-15")
    assert accelerometer.full_scale == 5.0


def test_the_driver_is_the_one_that_machine_toml_names(trial: MachineFolder, beam: Path) -> None:
    with dataq_device(trial) as device, open_device(trial.machine.daq, device.port) as source:
        assert isinstance(source, DataqSource)
        assert source.loss_detection == "digital word"
    toml = trial.toml.read_text("utf-8")
    trial.toml.write_text(toml.replace("[[daq", "loss_detection = false\n[[daq", 1), "utf-8")
    silent = MachineFolder("trial").machine.daq
    with dataq_device(trial) as device, open_device(silent, device.port) as source:
        assert isinstance(source, DataqSource)
        assert source.loss_detection == "none"
    trial.toml.write_text(toml.replace(CHANNELS, ""), "utf-8")
    with open_device(trial.machine.daq, f"file:{beam}") as source:
        assert isinstance(source, FileSource)
        assert source.sample_rate == pytest.approx(50_000, rel=1e-3)
    with taps_device(trial) as device, open_device(MachineFolder("trial").machine.daq, device.port) as source:
        assert isinstance(source, TapsSource)


def test_ports_names_the_device_that_answers(run: Any, trial: MachineFolder) -> None:
    for device, driver, model in (
        (dataq_device(trial), "dataq", "DI-4108"),
        (taps_device(trial), "taps", "lobewatch emulator"),
    ):
        with device:
            said = run("ports", "--port", device.port)
            found = json.loads(run("ports", "--port", device.port, "--json").out)["ports"]
        assert model in said.out
        assert f"lobewatch tap MACHINE --port {device.port}" in said.out
        assert f'driver = "{driver}"' in said.out
        assert [(one["device"], one["answer"]["model"], one["problem"]) for one in found] == [
            (device.port, model, None)
        ]


def test_ports_lists_all_but_asks_only_usb_devices(
    run: Any, trial: MachineFolder, monkeypatch: pytest.MonkeyPatch
) -> None:
    with dataq_device(trial) as device:
        listed = [
            PortInfo("/dev/ttyS0", description="modem"),
            PortInfo(device.port, 0x0683, 0x4108, "5E0ABC12", "DATAQ [CDC]"),
            PortInfo("/dev/ttyNOT_THERE", 0x16C0, 0x0483, "123", "USB Serial"),
        ]
        monkeypatch.setattr(sys.modules["acquisition.devices.port_scan"], "list_serial_ports", lambda: listed)
        said = run("ports")
    lines = said.out.splitlines()
    assert lines[1].startswith("/dev/ttyS0")
    assert "4108" not in lines[1]
    assert "0683:4108" in lines[2]
    assert "DATAQ [CDC]" in lines[2]
    assert "firmware 1.35" in lines[2]
    assert "16c0:0483" in lines[3]
    assert "/dev/ttyNOT_THERE" in lines[4]
    assert "No such file" in lines[4]
    assert lines[5].startswith("1 of 3")


def test_a_port_in_use_is_reported_to_be_so(run: Any, trial: MachineFolder) -> None:
    with dataq_device(trial) as device, open_device(trial.machine.daq, device.port):
        (port,) = json.loads(run("ports", "--port", device.port, "--json").out)["ports"]
    assert port["answer"] is None
    assert device.port in port["problem"]


def test_no_port_at_all_gets_a_sentence_with_the_cure(run: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.modules["acquisition.devices.port_scan"], "list_serial_ports", list)
    said = run("ports")
    assert said.code == 0
    assert "DAQ" in said.out
    assert json.loads(run("ports", "--json").out) == {"ports": [], "remarks": []}
    assert "dmesg" in explain_no_ports("linux")
    assert "Device Manager" in explain_no_ports("win32")
    assert "cu.usbmodem" in explain_no_ports("darwin")


@pytest.mark.parametrize(
    ("platform", "error", "cure"),
    [
        ("linux", PermissionError(errno.EACCES, "Permission denied"), "sudo usermod -aG dialout $USER"),
        ("darwin", PermissionError(errno.EACCES, "Permission denied"), "administrator"),
        ("win32", PermissionError(errno.EACCES, "Access is denied"), "program"),
        (
            "linux",
            serial.SerialException(errno.EWOULDBLOCK, "Could not exclusively lock port"),
            "`sudo fuser -v /dev/x`",
        ),
        ("linux", serial.SerialException(errno.EBUSY, "Device or resource busy"), "ModemManager"),
        ("win32", FileNotFoundError(errno.ENOENT, "No such file"), "cable"),
    ],
)
def test_what_is_wrong_with_a_port_is_reported_with_the_cure_of_the_platform(
    platform: str, error: Exception, cure: str
) -> None:
    text = str(explain_open_error("/dev/x", error, platform))
    assert "/dev/x" in text
    assert cure in text


def test_the_group_in_the_cure_is_that_of_the_port(tmp_path: Path) -> None:
    port = tmp_path / "ttyACM0"
    port.touch()
    error = PermissionError(errno.EACCES, "Permission denied")
    assert f"usermod -aG {port.group()} $USER" in explain_open_error(str(port), error, "linux").cure


@pytest.mark.parametrize(
    ("vendor", "first"),
    [(0x0683, b"stop\r"), (0x16C0, b"\x00" + encode_frame(Frame(MessageType.HELLO)))],
    ids=["dataq", "other"],
)
def test_a_strange_device_hears_one_question_only(monkeypatch: pytest.MonkeyPatch, vendor: int, first: bytes) -> None:
    monkeypatch.setattr("acquisition.dataq.protocol.DATAQ_ECHO_TIMEOUT", 0.05)
    monkeypatch.setattr("acquisition.dataq.protocol.DATAQ_STOP_SILENCE", 0.05)
    monkeypatch.setattr("acquisition.taps.source.TAPS_PROBE_TIMEOUT", 0.05)
    master, slave = os.openpty()
    try:
        import tty

        tty.setraw(slave)
        assert probe_port(os.ttyname(slave), BUILT_IN_DRIVERS, vendor) is None
        heard = os.read(master, 4096)
    finally:
        os.close(master)
        os.close(slave)
    assert heard in (first, first + b"info 0\r")


def test_a_device_that_the_wrong_driver_has_talked_to_is_named_all_the_same(trial: MachineFolder) -> None:
    with taps_device(trial) as device:
        handle = os.open(device.port, os.O_RDWR | os.O_NOCTTY)
        os.write(handle, b"stop\rinfo 0\r")
        found = probe_port(device.port, BUILT_IN_DRIVERS)
        os.close(handle)
    assert found is not None
    assert found.driver == "taps"


def test_a_device_that_talks_nonsense_is_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    class Babbler:
        port = "COM1"

        def __init__(self, _port: str) -> None:
            self.closed = False

        def write(self, _data: bytes) -> None: ...

        def read(self, _timeout: float) -> bytes:
            return encode_frame(Frame(MessageType.INFO, body=b"[1, 2]"))

        def close(self) -> None: ...

    monkeypatch.setattr("acquisition.dataq.protocol.DATAQ_STOP_SILENCE", 0.01)
    monkeypatch.setattr(sys.modules["acquisition.devices.port_scan"], "SerialLink", Babbler)
    assert probe_port("COM1", BUILT_IN_DRIVERS) is None


def test_old_firmware_is_named_all_the_same(trial: MachineFolder) -> None:
    device = dataq_device(trial)
    device._info[2] = DataqTraits(firmware="1.20").firmware  # noqa: SLF001
    with device:
        found = probe_port(device.port, BUILT_IN_DRIVERS)
    assert found is not None
    assert (found.driver, found.identity.firmware) == ("dataq", "1.20")


def test_the_ports_of_the_system_are_listed_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    from serial.tools.list_ports_common import ListPortInfo

    ports = [ListPortInfo("/dev/ttyACM1"), ListPortInfo("/dev/ttyACM0")]
    ports[0].vid, ports[0].pid, ports[0].serial_number = 0x0683, 0x4108, "5E0ABC12"
    monkeypatch.setattr(sys.modules["acquisition.ports.serial_ports"], "comports", lambda: ports)
    assert [port.device for port in list_serial_ports()] == ["/dev/ttyACM0", "/dev/ttyACM1"]
    assert list_serial_ports()[1] == PortInfo("/dev/ttyACM1", 0x0683, 0x4108, "5E0ABC12", "n/a")
    assert list_serial_ports()[0].vendor is None


def test_the_emulator_command_serves_a_dataq_device(run: Any, trial: MachineFolder) -> None:
    command = [sys.executable, "-m", "lobewatch.cli", "emulate", "dataq", "trial", "--json"]
    path = str(Path(__file__).parents[3])
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ | {"PYTHONPATH": path}
    ) as process:
        assert process.stdout is not None
        served = json.loads(process.stdout.readline())
        assert served["frequency_hz"] == pytest.approx(1713.05, abs=0.01)
        assert "DI-4108" in run("ports", "--port", served["port"]).out
        process.terminate()
        _, err = process.communicate(timeout=100)
    assert process.returncode == 130
    assert "Traceback" not in err


def test_a_driver_without_an_emulator_says_so(trial: MachineFolder) -> None:
    with pytest.raises(DataError, match="a TAPS/1 device"):
        emulate_machine(trial, replace(find_driver("taps"), emulate=None))


def test_the_emulator_needs_sensors(run: Any, trial: MachineFolder) -> None:
    trial.toml.write_text(trial.toml.read_text("utf-8").replace(CHANNELS, ""), "utf-8")
    said = run("emulate", "dataq", "trial")
    assert said.code == 2
    assert 'driver = "dataq"' in said.err
    assert "[[daq.channel]]" in said.err


def test_the_udev_rule_in_the_documentation_is_the_shipped_one() -> None:
    page = (Path(__file__).parents[3] / "docs" / "devices.md").read_text("utf-8")
    rule = resources.files("lobewatch.machine").joinpath("60-lobewatch.rules").read_text("utf-8")
    assert f"```\n{rule}```" in page
    assert "0683" in rule
