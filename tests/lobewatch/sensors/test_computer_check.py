"""`lobewatch doctor`: obstacles on a computer, each with its remedy."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from acquisition import DeviceAnswer, DeviceError, DeviceIdentity, PortInfo, PortScan, ScannedPort
from lobewatch.cli import main
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.sensors.computer_check import Finding, check_computer

EXAMINE = sys.modules["lobewatch.sensors.computer_check"]
NOW = datetime(2026, 6, 1, 12, tzinfo=UTC).timestamp()


@pytest.fixture
def healthy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a healthy computer, and the folder that replaces /sys."""
    monkeypatch.chdir(tmp_path)
    answer = DeviceAnswer("taps", DeviceIdentity("BOARD-1", "7"))
    survey = PortScan((ScannedPort(PortInfo("/dev/ttyACM0", 0x2E8A), answer),))
    monkeypatch.setattr(EXAMINE, "scan_ports", lambda: survey)
    monkeypatch.setattr(EXAMINE, "LATENCY_TIMER_FOLDER", tmp_path)
    monkeypatch.setattr("webbrowser.get", lambda: SimpleNamespace())
    monkeypatch.setattr("os.getloadavg", lambda: (0.1, 0.1, 0.1))
    monkeypatch.setattr(shutil, "disk_usage", lambda _folder: SimpleNamespace(free=50 << 30))
    return tmp_path


def worst(machine: MachineFolder | None = None, now: float = NOW) -> list[Finding]:
    return [finding for finding in check_computer(machine, now) if finding.state != "fine"]


@pytest.mark.quick
def test_nothing_is_reported_of_a_healthy_computer(healthy: Path) -> None:
    assert worst() == []
    text = {finding.subject: finding.text for finding in check_computer(None, NOW)}
    assert text["port /dev/ttyACM0"] == "BOARD-1 answers (taps)"
    assert text["clock"] == "2026-06-01 12:00 UTC"
    assert "mqtt" in text["extras"]


def break_rights(monkeypatch: pytest.MonkeyPatch, _folder: Path) -> None:
    failure = DeviceError("port /dev/ttyACM0 cannot be opened", "Run sudo usermod -aG dialout $USER")
    survey = PortScan((ScannedPort(PortInfo("/dev/ttyACM0", 1), text="cannot be opened", failure=failure),))
    monkeypatch.setattr(EXAMINE, "scan_ports", lambda: survey)


def slow_latency(_monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    (folder / "ttyUSB0").mkdir()
    (folder / "ttyUSB0" / "latency_timer").write_text("16\n", "ascii")


def full_disk(monkeypatch: pytest.MonkeyPatch, _folder: Path) -> None:
    monkeypatch.setattr(shutil, "disk_usage", lambda _folder: SimpleNamespace(free=1 << 20))


def no_browser(monkeypatch: pytest.MonkeyPatch, _folder: Path) -> None:
    def get() -> Any:
        import webbrowser

        raise webbrowser.Error("could not locate runnable browser")

    monkeypatch.setattr("webbrowser.get", get)


def busy(monkeypatch: pytest.MonkeyPatch, _folder: Path) -> None:
    monkeypatch.setattr("os.getloadavg", lambda: (99.0, 9.0, 9.0))


@pytest.mark.parametrize(
    ("harm", "subject", "state", "cure"),
    [
        (break_rights, "port /dev/ttyACM0", "hinders", "usermod -aG dialout"),
        (slow_latency, "latency of ttyUSB0", "note", "echo 1 | sudo tee"),
        (full_disk, "disk of", "hinders", "disk"),
        (no_browser, "browser", "note", "ScreenServer.listen 0.0.0.0"),
        (busy, "processor", "note", "programs"),
    ],
)
def test_one_fault_is_one_line_with_its_cure(
    harm: Callable[[pytest.MonkeyPatch, Path], None],
    subject: str,
    state: str,
    cure: str,
    healthy: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    harm(monkeypatch, healthy)
    (finding,) = worst()
    assert finding.subject.startswith(subject)
    assert finding.state == state
    assert cure in finding.cure


def test_a_clock_that_lags_behind(healthy: Path) -> None:
    (finding,) = worst(now=datetime(2001, 1, 1, tzinfo=UTC).timestamp())
    assert (finding.subject, finding.state) == ("clock", "hinders")


def test_a_machine_whose_port_and_library_are_missing(
    healthy: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    make_machine_folder(Path("mill"), "new_machine.toml")
    toml = Path("mill/machine.toml")
    channel = '[[daq.channel]]\ninput = {}\nquantity = "{}"\n{}\nrange_v = 5\n'
    channels = channel.format(0, "force", "sensitivity_mv_per_n = 2") + channel.format(
        1, "acceleration", "sensitivity_mv_per_g = 10"
    )
    daq = f'[daq]\ndriver = "ljm"\nport = "/dev/ttyGONE"\n{channels}\n'
    toml.write_text(toml.read_text("utf-8").replace("[daq]\n", daq, 1), "utf-8")
    found = {finding.subject: finding for finding in worst(MachineFolder("mill"))}
    assert set(found) == {"port /dev/ttyGONE", "driver"}
    assert all(fact in found["port /dev/ttyGONE"].text for fact in ("[daq]", "/dev/ttyGONE", "(No such file"))
    assert "pip install 'lobewatch[ljm]'" in found["driver"].cure
    monkeypatch.setattr(sys, "argv", ["lobewatch", "doctor", "mill", "--json"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 1
    assert json.loads(capsys.readouterr().out)["hinder"] == 2
    monkeypatch.setattr(sys, "argv", ["lobewatch", "doctor"])
    with pytest.raises(SystemExit) as end:
        main()
    assert (end.value.code or 0) == 0
    assert capsys.readouterr().out
