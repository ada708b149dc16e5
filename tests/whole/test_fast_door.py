"""The door is fast: no numbers, pictures or servers are imported before they are needed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from lobewatch.commands import COMMANDS

HEAVY = {"numpy", "scipy", "matplotlib", "aiohttp", "h5py", "jinja2"}
NUMERICAL = {f"scipy.{part}" for part in ("signal", "stats", "interpolate", "optimize", "special", "ndimage", "linalg")}
COMMAND_LINE = """
import sys
sys.argv[0] = "lobewatch"
from lobewatch.cli import main
try:
    main()
finally:
    print(*sys.modules, file=sys.stderr)
"""


def imported(code: str, *arguments: str, cwd: Path, exit_code: int = 0) -> set[str]:
    """Modules that are there after some code."""
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], cwd=cwd, capture_output=True, text=True, timeout=110, check=False
    )
    assert done.returncode == exit_code, done.stderr
    return set(done.stderr.split())


@pytest.mark.parametrize(
    ("line", "exit_code"),
    [
        ("--help", 0),
        ("--version", 0),
        ("", 2),
        ("chek", 2),
        ("init mill", 0),
        *((f"{name} --help", 0) for name in COMMANDS),
        ("emulate taps --help", 0),
    ],
)
def test_the_command_line_starts_without_heavy_packages(line: str, exit_code: int, tmp_path: Path) -> None:
    modules = imported(COMMAND_LINE, *line.split(), cwd=tmp_path, exit_code=exit_code)
    assert "lobewatch.cli" in modules
    assert not HEAVY & modules


@pytest.mark.parametrize("line", ["--help", "--version", "chek"])
def test_the_first_word_does_not_wait_for_rich_and_pydantic(line: str, tmp_path: Path) -> None:
    modules = imported(COMMAND_LINE, line, cwd=tmp_path, exit_code=2 if line == "chek" else 0)
    assert not {"rich", "pydantic"} & modules


@pytest.mark.parametrize(
    ("code", "left_out"),
    [
        ("from acquisition import *", {"scipy.signal", "scipy.stats"}),
        (
            "from modal import *\nfrom lobes import *\n"
            "import lobewatch.logbook.logbook, lobewatch.monitoring.machine_status",
            NUMERICAL,
        ),
        ("import dsm", NUMERICAL - {"scipy.linalg"}),
        ("import acquisition.ports, acquisition.file_io, acquisition.errors", HEAVY),
        ("import lobewatch, lobewatch.machine.folder_files", HEAVY),
        ("import lobewatch.logbook.logbook", {"asyncio", "multiprocessing", "acquisition.emulation.emulated_device"}),
    ],
)
def test_imports_leave_out_what_they_do_not_need(code: str, left_out: set[str], tmp_path: Path) -> None:
    modules = imported(f"import sys\n{code}\nprint(*sys.modules, file=sys.stderr)", cwd=tmp_path)
    assert not left_out & modules


def test_a_history_waits_neither_for_hdf5_nor_for_what_fits_modes(tmp_path: Path) -> None:
    imported(COMMAND_LINE, "init", "mill", "--example", cwd=tmp_path)
    modules = imported(COMMAND_LINE, "history", "mill", cwd=tmp_path)
    assert "lobewatch.history.history" in modules
    assert not ({"h5py", "matplotlib"} | NUMERICAL) & modules


def test_a_report_waits_for_no_server_and_lobes_that_are_not_drawn_for_no_pictures(tmp_path: Path) -> None:
    modules = imported(COMMAND_LINE, "demo", "--taps", "2", "--out", "mill", cwd=tmp_path)
    assert "lobewatch.show.report.report" in modules
    assert "aiohttp" not in modules
    assert "matplotlib" not in imported(COMMAND_LINE, "lobes", "mill", cwd=tmp_path)
    assert "matplotlib" in imported(COMMAND_LINE, "lobes", "mill", "--figure", "lobes.svg", cwd=tmp_path)
