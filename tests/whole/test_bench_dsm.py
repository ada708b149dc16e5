"""The benchmark of the spindle model runs, and its errors are what they should be; how fast it is, is not tested."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

BENCH = Path(__file__).parents[2] / "bench" / "bench_dsm.py"


def test_quick_benchmark_prints_its_tables() -> None:
    run = subprocess.run([sys.executable, str(BENCH), "--quick"], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    assert "ROSS is left out" in run.stdout
    assert len(re.findall(r"^\S.*, (?:euler-bernoulli|timoshenko)$", run.stdout, re.MULTILINE)) == 10
    coarse = re.search(r"54 dof, eigh \+ brentq .* error (\S+)", run.stdout)
    refined = re.search(r"3 elements a segment, 158 dof, eigh \+ brentq .* error (\S+)", run.stdout)
    assert coarse is not None
    assert refined is not None
    assert 5e-5 < float(coarse[1]) < 2e-4
    assert float(refined[1]) < 2e-6
    assert all(float(error) < 1e-9 for error in re.findall(r"eigenproblem a frequency .* error (\S+)", run.stdout))
