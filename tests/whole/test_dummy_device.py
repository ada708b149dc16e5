"""A driver in a package of its own is found by every command, without a change to ours."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder

ROOT = Path(__file__).parents[2]
PLUGIN = ROOT / "tests" / "plugins" / "dummy_device"


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "lobewatch.cli", *arguments]


def environment(*folders: Path) -> dict[str, str]:
    return os.environ | {"PYTHONPATH": os.pathsep.join(map(str, (ROOT, *folders)))}


def run(*arguments: str, plugin: Path = PLUGIN) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command(*arguments), capture_output=True, text=True, env=environment(plugin), check=False, timeout=90
    )


@pytest.fixture
def trial(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the example machine with a dummy device, in the working directory."""
    monkeypatch.chdir(tmp_path)
    make_machine_folder(Path("trial"), "surrogate_machine.toml")
    toml = Path("trial/machine.toml")
    toml.write_text(toml.read_text("utf-8").replace("[daq]\n", '[daq]\ndriver = "dummy"\n', 1), "utf-8")
    return toml


@contextmanager
def emulated(*options: str) -> Iterator[str]:
    """Yield the port of a dummy device."""
    with subprocess.Popen(
        command("emulate", "dummy", "trial", "--json", *options),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(PLUGIN),
    ) as process:
        assert process.stdout is not None
        served = process.stdout.readline()
        try:
            assert json.loads(served)["frequency_hz"] == pytest.approx(1713.05, abs=0.01)
            yield json.loads(served)["port"]
        finally:
            process.terminate()
            _, err = process.communicate(timeout=100)
            assert (process.returncode, "Traceback" in err) == (130, False), err


def test_ports_and_a_whole_tap_test(trial: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with emulated("--fast") as port:
        seen = run("ports", "--port", port)
        assert "dummy: DUMMY-1, serial number 0042, firmware 1.0" in seen.stdout, seen.stderr
        assert 'driver = "dummy" in [daq] of machine.toml' in seen.stdout
        tapped = run("tap", "trial", "--port", port, "--details")
    assert tapped.returncode == 0, tapped.stderr
    assert "DUMMY-1, 25600 Hz" in tapped.stderr
    assert re.search(r"followed mode: 171[234]\.", tapped.stdout)
    monkeypatch.syspath_prepend(PLUGIN)
    folder = MachineFolder("trial")
    (entry,) = folder.taps()
    device = "DUMMY-1, serial number 0042, firmware 1.0, loss detection: scan numbers"
    assert folder.read(entry).circumstances.device == device


def test_its_sensors_and_its_rate(trial: Path) -> None:
    with emulated() as port:
        said = run("sensors", "trial", "--port", port, "--json")
    assert said.returncode == 0, said.stderr
    found = json.loads(said.stdout)
    assert (found["model"], found["serial"]) == ("DUMMY-1", "0042")
    assert found["measured_rate_hz"] == pytest.approx(25600, rel=2e-3)
    assert "0042" in Path("trial/daq.json").read_text("utf-8")


def test_a_package_that_cannot_be_loaded_is_named_and_disables_nothing(trial: Path, tmp_path: Path) -> None:
    broken = tmp_path / "site" / "broken_daq-0.3.dist-info"
    broken.mkdir(parents=True)
    (broken / "METADATA").write_text("Metadata-Version: 2.1\nName: broken-daq\nVersion: 0.3\n", "utf-8")
    (broken / "entry_points.txt").write_text("[lobewatch.drivers]\nbroken = no_such_module:DRIVER\n", "utf-8")
    said = run("emulate", "broken", "trial", plugin=broken.parent)
    reason = "the package broken-daq cannot be loaded (ModuleNotFoundError: No module named 'no_such_module')"
    assert (said.returncode, said.stderr) == (2, f"error: driver 'broken': {reason}. Update or remove the package.\n")
    listed = run("ports", "--json", plugin=broken.parent)
    assert listed.returncode == 0, listed.stderr
    assert json.loads(listed.stdout)["remarks"] == [
        {
            "code": "package-not-loaded",
            "about": "driver 'broken'",
            "text": reason,
            "cure": "Update or remove the package",
        }
    ]


def test_a_device_that_is_on_no_serial_port(trial: Path) -> None:
    bench = PLUGIN.parent / "dummy_bench"
    trial.write_text(trial.read_text("utf-8").replace('"dummy"', '"dummybench"\nport = "dummybench:left"', 1), "utf-8")
    listed = run("ports", plugin=bench)
    assert "dummybench:left" in listed.stdout
    assert "dummybench: BENCH-1, serial number 0007, firmware 2.0" in listed.stdout
    (only,) = json.loads(run("ports", "--port", "dummybench:left", "--json", plugin=bench).stdout)["ports"]
    assert (only["description"], only["answer"]["model"]) == ("bench at the window", "BENCH-1")
    tapped = run("tap", "trial", "--direction", "x", "--json", plugin=bench)
    assert tapped.returncode == 0, tapped.stderr
    assert json.loads(tapped.stdout)["followed"]["frequency_hz"] == pytest.approx(1700.0, abs=0.5)
    wrong = run("tap", "trial", "--port", "dummybench:right", plugin=bench)
    assert (wrong.returncode, wrong.stderr.splitlines()[-1]) == (
        2,
        "error: there is no bench dummybench:right. Use dummybench:left.",
    )
