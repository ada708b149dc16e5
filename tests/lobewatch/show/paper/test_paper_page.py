"""Test that docs/paper.md is what `lobewatch paper --out docs` writes."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from typer.testing import CliRunner

from lobewatch.cli import app, main
from lobewatch.show.paper.paper_page import PAPER_FIGURES

DOCS = Path(__file__).parents[4] / "docs"
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
ROUNDING = re.compile(r"^\| error of (?:the roots|A B).*$\n", re.MULTILINE)
"""Lines that show rounding, another with each processor."""
SAME = 3e-5
"""Relative difference that another processor makes at most."""
PALE = 4.0
"""Mean difference of a picture's dot from its neighbourhood (of 255) that no eye sees."""


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Return the folder, and the output on a terminal of 80 characters."""
    folder = tmp_path_factory.mktemp("out") / "paper"
    done = CliRunner(env={"COLUMNS": "80"}).invoke(app, ["paper", "--out", str(folder)])
    assert done.exit_code == 0, done.output
    return folder, done.stdout


def test_the_page_is_the_one_in_docs(written: tuple[Path, str]) -> None:
    texts = [ROUNDING.sub("", (folder / "paper.md").read_text("utf-8")) for folder in (written[0], DOCS)]
    assert NUMBER.split(texts[0]) == NUMBER.split(texts[1]), "run lobewatch paper --out docs, and read the difference"
    new, old = ([*map(float, NUMBER.findall(text))] for text in texts)
    assert new == pytest.approx(old, rel=SAME, abs=1e-12)


@pytest.mark.parametrize("name", PAPER_FIGURES)
def test_the_figure_is_the_one_in_docs(written: tuple[Path, str], name: str) -> None:
    new, old = (pixels(folder / "images" / f"paper-{name}.png") for folder in (written[0], DOCS))
    assert new.shape == old.shape
    assert np.max(np.abs(new - old)) < PALE, f"what is new: {written[0]}"


def pixels(path: Path) -> NDArray[np.float64]:
    """Return the pixels of a figure, 0 to 255, at a third of its resolution."""
    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB").reduce(3), dtype=np.float64)


def test_the_page_shows_every_figure(written: tuple[Path, str]) -> None:
    links = re.findall(r"\]\(images/paper-([\w-]+)\.png\)", (written[0] / "paper.md").read_text("utf-8"))
    assert sorted(links) == sorted(PAPER_FIGURES)


def test_the_table_fits_80_characters_and_says_where_the_page_is(written: tuple[Path, str]) -> None:
    lines = written[1].splitlines()
    assert all(len(line) <= 80 for line in lines[:-1])
    assert lines[-1] == f"page: {written[0] / 'paper.md'}"
    row = next(line for line in lines if line.startswith("K_theo by (30)"))
    assert row.split() == ["K_theo", "by", "(30)", "to", "(36)", "(36)", "2.90601e7", "2.7393e7", "N/m", "-5.7", "%"]


def test_json_and_mistakes(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    def ask(*words: str) -> tuple[Any, str, str]:
        monkeypatch.setattr(sys, "argv", ["lobewatch", "paper", *words])
        with pytest.raises(SystemExit) as end:
            main()
        return end.value.code, *capsys.readouterr()

    code, text, _ = ask("--json")
    answer = json.loads(text)
    assert code == 0
    assert answer["page"] is None
    row = next(row for row in answer["numbers"] if row["quantity"] == "K_theo by (30) to (36)")
    assert (row["unit"], row["paper"]) == ("N/m", 2.90601e7)
    assert row["difference"] == pytest.approx(row["ours"] / 2.90601e7 - 1)
    assert {claim["verdict"] for claim in answer["claims"]} == {"holds", "holds in part", "fails"}
    (tmp_path / "file").touch()
    code, text, error = ask("--out", str(tmp_path / "file"))
    assert (code, text) == (2, "")
    assert f"{tmp_path / 'file'}: " in error
    assert "--out" in error
