"""The table of public files lists the files present."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path

import numpy as np
import public_files
import pytest

F = np.arange(1.0, 400.0)
H = 1 / (4e8 * (1 - (F / 150) ** 2 + 0.02j * F / 150))


def put(folder: Path, name: str, heading: str) -> None:
    (folder / name).parent.mkdir(parents=True, exist_ok=True)
    rows = "".join(f"{f:g}\t{h.real:.9e}\t{h.imag:.9e}\n" for f, h in zip(F, H, strict=True))
    (folder / name).write_text(heading + rows, encoding="utf-8")


def test_rows_of_the_files_that_are_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    put(tmp_path, f"{public_files.DYNAMICS}/TimeDomain/SemiDis/Milling/X.frf", "Freq (Hz)\tReal (m/N)\tImag (m/N)\n")
    put(tmp_path, f"{public_files.SIGNALS}/ExperimentalModalAnalysis/Point_1.txt", "")
    put(tmp_path, f"{public_files.DYNAMICS}/FrequencyDomain/Milling/FRF.mat", "no file of MATLAB\n")
    monkeypatch.setattr(sys, "argv", ["public_files.py", str(tmp_path)])
    public_files.main()
    _, _, frf, mat, text = capsys.readouterr().out.splitlines()
    assert frf.endswith("| nothing | 1 of 1 | 1 trusted: 150 Hz |")
    assert text.endswith('| `--columns "frequency,real [m/N],imag"` | 1 of 1 | 1 trusted: 150 Hz |')
    assert "| 0 of 1 | refused: " in mat


def test_the_table_in_the_docs_has_these_files() -> None:
    docs = (Path(__file__).parents[2] / "docs" / "studies" / "public-files.md").read_text(encoding="utf-8")
    for entry in public_files.FILES:
        assert f"| `{entry.pattern}` | " in docs
        assert all(
            word.startswith(("-", "@")) or " " not in word or f'"{word}"' in docs for word in shlex.split(entry.answers)
        )
