"""CONTRIBUTING.md and examples/ are enough for a driver and a format: their code runs as it stands there."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from acquisition import HammeredStructure, Structure, Trigger, capture_hits
from acquisition.emulation import SimulatedSource
from lobewatch.commands import COMMANDS
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.tap.emulated_spindle import EMULATED_CHANNELS

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
ROOMS = {"show/", "screen/", "commands/", "logbook/", "sensors/", "tap/"}
"""Named without their package."""


@pytest.fixture
def environment(tmp_path: Path) -> dict[str, str]:
    """With both packages of the page as an installer leaves them."""
    projects = re.findall(r"^```toml\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    modules = re.findall(r"^```python\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
    driver = ROOT / "examples" / "own_driver"
    assert projects[0] == (driver / "pyproject.toml").read_text("utf-8")
    modules.insert(0, (driver / "lobewatch_acme.py").read_text("utf-8"))
    assert len(projects) == len(modules) == 2
    site = tmp_path / "site"
    for text, module in zip(projects, modules, strict=True):
        project = tomllib.loads(text)
        name, points = project["project"]["name"], project["project"]["entry-points"]
        (module_name,) = project["tool"]["setuptools"]["py-modules"]
        metadata = site / f"{module_name}-1.0.dist-info"
        metadata.mkdir(parents=True)
        (metadata / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", "utf-8")
        lines = [f"[{group}]\n{key} = {value}\n" for group in points for key, value in points[group].items()]
        (metadata / "entry_points.txt").write_text("".join(lines), "utf-8")
        (site / f"{module_name}.py").write_text(module, "utf-8")
    return os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(site)])}


def lobewatch(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "lobewatch.cli", *map(str, arguments)]


def run(environment: dict[str, str], *arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        lobewatch(*arguments), capture_output=True, text=True, env=environment, check=False, timeout=110
    )


def test_the_driver_taps(environment: dict[str, str], tmp_path: Path) -> None:
    trial = tmp_path / "trial"
    toml = make_machine_folder(trial, "surrogate_machine.toml")
    text = toml.read_text("utf-8").replace("[daq]\n", '[daq]\ndriver = "acme"\n', 1).replace("hits = 10", "hits = 3")
    toml.write_text(text, "utf-8")
    served = lobewatch("emulate", "acme", trial, "--json")
    with subprocess.Popen(served, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment) as process:
        assert process.stdout is not None
        port = json.loads(process.stdout.readline())["port"]
        try:
            assert "acme: ACME-1, serial number EMULATED" in run(environment, "ports", "--port", port).stdout
            said = run(environment, "tap", trial, "--port", port, "--json")
        finally:
            process.terminate()
    assert said.returncode == 0, said.stderr
    assert json.loads(said.stdout)["followed"]["frequency_hz"] == pytest.approx(1713.05, rel=1e-3)


def test_the_format_is_read(environment: dict[str, str], structure: Structure, tmp_path: Path) -> None:
    tapper = HammeredStructure(structure, 25600.0, np.random.default_rng(1))
    hit = next(
        iter(capture_hits(SimulatedSource(tapper, EMULATED_CHANNELS, 25600.0, 60_000), Trigger(20.0, 6400, 512)))
    )
    file = tmp_path / "hit.txt"
    rows = [f"{force:.9g} {acceleration:.9g}" for force, acceleration in zip(hit.force, hit.acceleration, strict=True)]
    file.write_text("\n".join(["ACME TAP", "25600", *rows]), "utf-8")
    said = run(environment, "modes", file, "--json")
    assert said.returncode == 0, said.stderr
    found = [mode["frequency_hz"] for mode in json.loads(said.stdout)["modes"]]
    assert min(abs(np.array(found) - 1722)) < 5
    file.write_text("ACME TAP\n25600\n1 x\n", "utf-8")
    assert run(environment, "modes", file).returncode == 2


def test_every_file_and_command_that_is_named_is_there() -> None:
    text = re.sub(r"^```.*?^```", "", PAGE, flags=re.MULTILINE | re.DOTALL)
    files = {place for place in re.findall(r"`([\w.*/-]*/[\w.*/-]*)`", text) if "NAME" not in place} - ROOMS
    assert {"acquisition/devices/drivers.py", ".ci/lock", "lobewatch/show/report/sections.py"} <= files
    assert {place for place in files if not list(ROOT.glob(place.rstrip("/")))} == set()
    assert set(re.findall(r"^\$ lobewatch ([a-z]+)", PAGE, re.MULTILINE)) <= COMMANDS.keys()
