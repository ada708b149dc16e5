"""Formats of other packages: found without a change to ours; a broken one is named and disables nothing."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from acquisition import list_formats, read_hits

PLUGIN = Path(__file__).parents[2] / "plugins" / "dummy_format"
RATE = 25600.0


def run(arguments: list[object], *plugins: Path) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(map(str, plugins))}
    command = [sys.executable, "-m", "lobewatch.cli", *map(str, arguments)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False, timeout=110)


def rows(columns: np.ndarray) -> str:
    return "".join(" ".join(f"{value:.9g}" for value in row) + "\n" for row in columns.T)


@pytest.fixture
def hit(tmp_path: Path) -> Path:
    """Write a hit on one mode at 512 Hz in the dummy format under a misleading name."""
    time = np.arange(12800) / RATE
    pulse = np.where(np.abs(time - 0.01) < 1e-3, 100 * np.cos(np.pi * (time - 0.01) / 2e-3) ** 2, 0.0)
    ringing = np.exp(-2 * np.pi * 512 * 0.02 * time) * np.sin(2 * np.pi * 512 * time)
    response = np.diff(np.convolve(pulse, ringing)[: time.size + 2], 2) * RATE**2 * 1e-9
    path = tmp_path / "hit.csv"
    path.write_text("DUMMY hit\n" + rows(np.stack([time, pulse, response])), encoding="ascii")
    return path


def plugin(folder: Path, package: str, code: str) -> Path:
    """Make a package whose entry point of the same name leads to `code`."""
    about = folder / f"{package}-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n", encoding="utf-8")
    (about / "entry_points.txt").write_text(f"[lobewatch.formats]\n{package} = {package}:FORMAT\n", encoding="utf-8")
    (folder / f"{package}.py").write_text(code, encoding="utf-8")
    return folder


def test_a_format_of_another_package_is_read_by_modes_and_replay(hit: Path, tmp_path: Path) -> None:
    said = run(["modes", hit, "--json"], PLUGIN)
    assert said.returncode == 0, said.stderr
    assert min(abs(mode["frequency_hz"] - 512) for mode in json.loads(said.stdout)["modes"]) < 2
    frf = tmp_path / "frf.dat"
    frequency = np.arange(100.0, 1000.0)
    receptance = 1 / (2e7 * (1 - (frequency / 512) ** 2 + 0.04j * frequency / 512))
    frf.write_text("DUMMY FRF\n" + rows(np.stack([frequency, receptance.real, receptance.imag])), encoding="ascii")
    assert run(["init", tmp_path / "mill"], PLUGIN).returncode == 0
    said = run(["replay", tmp_path / "mill", hit, frf, "--json"], PLUGIN)
    assert said.returncode == 0, said.stderr
    first, second = json.loads(said.stdout)["measurements"]
    assert (first["time"][:10], first["tool"], first["direction"]) == ("2021-05-04", "dummy tool", "y")
    assert second["modes"][0]["frequency_hz"] == pytest.approx(512, abs=0.5)
    assert second["modes"][0]["stiffness_n_per_m"] == pytest.approx(2e7, rel=0.01)


def test_without_the_package_its_files_are_rejected(hit: Path) -> None:
    said = run(["modes", hit])
    assert said.returncode == 2
    assert "columns column 1, " in said.stderr
    assert "broken" not in said.stderr


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        ("import no_such_module\n", "ModuleNotFoundError: No module named 'no_such_module'"),
        ("1 / 0\n", "ZeroDivisionError"),
        ("", "AttributeError"),
        ("FORMAT = 'csv'\n", "acquisition.Format"),
        (
            "from acquisition import Format\nFORMAT = Format('lvm', 'x', (), lambda head, path: True, print)\n",
            "'lvm'",
        ),
    ],
)
def test_a_broken_package_is_named_and_disables_nothing(hit: Path, tmp_path: Path, code: str, reason: str) -> None:
    broken = plugin(tmp_path / "site", "bad_format", code)
    strange = tmp_path / "strange.bin"
    strange.write_bytes(bytes(range(256)))
    script = (
        "import sys; from acquisition import DataError, read_recording\n"
        "print(len(read_recording(sys.argv[1])))\n"
        "try:\n    read_recording(sys.argv[2])\nexcept DataError as error:\n    print(error)\n"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(broken), str(PLUGIN)])}
    command = [sys.executable, "-c", script, str(hit), str(strange)]
    said = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=110)
    count, message = said.stdout.splitlines()
    assert count == "1"
    assert "recording of the dummy (.dum), tap" in message
    assert "format 'bad_format': " in message
    assert reason in message


def test_a_table_that_fails_names_the_broken_package_too(tmp_path: Path, beam: Path) -> None:
    broken = plugin(tmp_path / "site", "bad_format", "import no_such_module\n")
    text = tmp_path / "notes.txt"
    text.write_text("Dear Sirs,\nno numbers here\n", encoding="utf-8")
    said = run(["modes", text], broken)
    assert said.returncode == 2
    assert said.stderr.count("\n") == 1
    assert re.search("line 2: .*format 'bad_format': .*package bad_format .*no_such_module", said.stderr)
    assert run(["modes", beam], broken).returncode == 0


def test_a_format_that_fails_on_a_file_is_left_out_or_named(tmp_path: Path, beam: Path) -> None:
    code = (
        "from acquisition import Format\n\n\n"
        "def is_it(head, path):\n    if head[:3] == b'bad':\n        return True\n    raise KeyError('head')\n\n\n"
        "FORMAT = Format('bad_format', 'bad format', ('.bad',), is_it, lambda path: {}['rows'])\n"
    )
    site = plugin(tmp_path / "site", "bad_format", code)
    said = run(["modes", beam], site)
    assert said.returncode == 0
    assert re.search(r"format 'bad_format' .*\(KeyError: 'head'\)", said.stderr)
    file = tmp_path / "file"
    file.write_bytes(b"bad")
    said = run(["modes", file], site)
    assert said.returncode == 2
    assert "bad format (KeyError: 'rows')" in said.stderr


def test_recordings_are_recognized_by_content_whatever_their_name(beam: Path, tmp_path: Path) -> None:
    assert [one.name for one in list_formats()] == [
        *("tap-file", "uff", "mat", "lvm", "tdms", "wav", "sep005", "numpy", "hdf5", "pulse", "table")
    ]
    renamed = tmp_path / "beam.csv"
    renamed.write_bytes(beam.read_bytes())
    (hit,) = read_hits(renamed)
    assert hit.force.size == 50030
