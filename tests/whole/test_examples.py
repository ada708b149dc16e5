"""The programs in examples/ run as they stand there, in an empty folder; so do the cells of the notebooks."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"
PRINTED = {
    "frf_to_lobes": r"4 modes, lowest limit 0\.6 mm at \d+ rpm",
    "folder_to_table": r"modes\.csv: 3 of \d+ files have modes",
    "report_section": r"report\.html$",
    "tool_library": r"100 mm out: softest mode 1275 Hz, 4\.6 N/um; a slot of 0\.35 mm",
    "calibration_study": r"f_1 within 0\.2 %: stiffness within 1\.4 %, 95 % interval held 94%",
    "forecast_csv": r"1624 Hz: between day 517 and 528 \(80 %\), probably day 522",
    "paper_figures": r"paper 0\.9000, model 0\.9856",
}
"""Last line printed by each program."""


def run(program: Path, folder: Path) -> str:
    environment = os.environ | {"MPLBACKEND": "Agg"}
    done = subprocess.run(
        [sys.executable, program], cwd=folder, capture_output=True, text=True, timeout=100, check=False, env=environment
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def test_none_is_left_out() -> None:
    assert {path.stem for path in EXAMPLES.glob("*.py")} == set(PRINTED)


@pytest.mark.parametrize("name", PRINTED)
def test_the_program_runs(name: str, tmp_path: Path) -> None:
    assert re.search(PRINTED[name], run(EXAMPLES / f"{name}.py", tmp_path).strip())
    if name == "report_section":
        assert re.search(r"Hammer</h2>.*peak force \(N\)", (tmp_path / "report.html").read_text("utf-8"), re.DOTALL)
    if "savefig" in (EXAMPLES / f"{name}.py").read_text("utf-8"):
        assert (tmp_path / f"{name}.png").stat().st_size > 10_000


@pytest.mark.parametrize("notebook", sorted(EXAMPLES.glob("*.ipynb")), ids=lambda path: path.stem)
def test_the_cells_of_the_notebook_run(notebook: Path, tmp_path: Path) -> None:
    cells = json.loads(notebook.read_text("utf-8"))["cells"]
    as_program = notebook.with_suffix(".py").read_text("utf-8").split('"""\n', 1)[1]
    code = "".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    assert "".join(code.split()) == "".join(as_program.split())
    program = tmp_path / f"{notebook.stem}.py"
    program.write_text("\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"), "utf-8")
    assert re.search(PRINTED[notebook.stem], run(program, tmp_path))
