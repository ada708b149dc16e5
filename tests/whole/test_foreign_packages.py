"""A distribution that brings its own `modal` or `dsm` is named in one sentence, before lobewatch uses it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from lobewatch.foreign_packages import OWN_INIT_TEXT, OWN_PACKAGES

ROOT = Path(__file__).parents[2]


def run(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run Python with the packages of a folder before those of the checkout."""
    places = os.pathsep.join([str(folder), str(ROOT)])
    command = [sys.executable, *arguments]
    return subprocess.run(
        command, env=os.environ | {"PYTHONPATH": places}, cwd=folder, capture_output=True, text=True, check=False
    )


def install(folder: Path, name: str) -> None:
    """Install a fake distribution `foreign-NAME` with a package NAME, as pip does."""
    (folder / name).mkdir()
    (folder / name / "__init__.py").write_text("class App: ...\n", encoding="utf-8")
    info = folder / f"foreign_{name}-1.2.3.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: foreign-{name}\nVersion: 1.2.3\n", encoding="utf-8")
    (info / "RECORD").write_text(f"{name}/__init__.py,,\n", encoding="utf-8")


def test_foreign_packages_are_named_by_every_use(tmp_path: Path) -> None:
    for name in ("modal", "dsm"):
        install(tmp_path, name)
    expected = ", ".join(f"{name} (of foreign-{name}, in {tmp_path / name})" for name in ("modal", "dsm"))
    doctor = run(tmp_path, "-m", "lobewatch", "doctor", "--json")
    (finding,) = json.loads(doctor.stdout)["findings"]
    assert (doctor.returncode, finding["subject"], finding["state"]) == (1, "foreign packages", "hinders")
    assert finding["text"].endswith(expected)
    command = run(tmp_path, "-m", "lobewatch", "status", ".")
    assert (command.returncode, command.stdout, command.stderr.count("\n")) == (2, "", 1)
    assert expected in command.stderr
    program = run(tmp_path, "-c", "import lobewatch.measurement.tap_measurement")
    assert expected in program.stderr.splitlines()[-1]


def test_a_foreign_package_that_was_imported_before_is_named(tmp_path: Path) -> None:
    install(tmp_path, "modal")
    program = run(tmp_path, "-c", "import modal, lobewatch")
    assert f"modal (of foreign-modal, in {tmp_path / 'modal'})" in program.stderr.splitlines()[-1]


def test_a_package_without_its_files_is_named(tmp_path: Path) -> None:
    (tmp_path / "modal.py").write_text("raise SystemExit('imported')", encoding="utf-8")
    doctor = run(tmp_path, "-m", "lobewatch", "doctor")
    assert doctor.returncode == 1
    assert "modal" in doctor.stdout
    assert "imported" not in doctor.stderr


@pytest.mark.parametrize("name", OWN_PACKAGES)
def test_each_package_is_known_by_its_text(name: str) -> None:
    assert OWN_INIT_TEXT in (ROOT / name / "__init__.py").read_bytes()
