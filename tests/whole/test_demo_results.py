"""What the demo and the commands on it come to, word by word and number by number: as it was when last looked at.

A change that is meant shows here: the new text lies in the folder that the failure names, to be read and copied.
"""

from __future__ import annotations

import importlib
import os
import pkgutil
import re
from datetime import datetime, tzinfo
from pathlib import Path

import pytest
from typer.testing import CliRunner

import lobewatch
from lobewatch.cli import app

SEEN = Path(__file__).parents[1] / "data" / "demo"
NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
SAME = 1e-6
"""Relative difference that another processor makes at most."""
QUESTIONS = {
    "check": [],
    "check --json": [],
    "trend": [],
    "trend --json": [],
    "suggest": ["--program", "B: slot at 6 200 rpm"],
    "suggest --json": ["--program", "B: slot at 6 200 rpm"],
    "lobes": [],
    "lobes --json": ["--method", "zero-order"],
    "model": [],
    "model --json": ["--tool", "long end mill"],
    "history": [],
    "history --json": [],
    "status": [],
}


class January(datetime):
    """A clock that stands five weeks after the last test of the demo."""

    @classmethod
    def now(cls, tz: tzinfo | None = None) -> January:
        """The same whenever it is asked."""
        return cls(2026, 1, 20, 9, tzinfo=tz)


@pytest.fixture(scope="module")
def answers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What is printed, by command."""
    here, runner = Path.cwd(), CliRunner(env={"COLUMNS": "100"})
    with pytest.MonkeyPatch.context() as patch:
        for name in [module.name for module in pkgutil.walk_packages(lobewatch.__path__, "lobewatch.")]:
            module = importlib.import_module(name)
            if getattr(module, "datetime", None) is datetime:
                patch.setattr(module, "datetime", January)
        os.chdir(tmp_path_factory.mktemp("demo"))
        try:
            printed = {"demo": runner.invoke(app, ["demo", "--seed", "5"]).stdout}
            for question, options in QUESTIONS.items():
                command, *more = question.split()
                told = runner.invoke(app, [command, "lobewatch-demo", *more, *options])
                assert told.exit_code in (0, 1), told.output
                printed[question] = told.stdout
            page = Path("lobewatch-demo/report.html").read_text("utf-8")
        finally:
            os.chdir(here)
    printed["report"] = re.sub(r"<(style|script|svg).*?</\1>\n*", "", page, flags=re.DOTALL)
    return {question: re.sub(r"(?<=_[xy]_)[0-9a-f]{4}\b", "0000", text) for question, text in printed.items()}


@pytest.mark.timeout(300)
@pytest.mark.parametrize("question", ["demo", "report", *QUESTIONS])
def test_the_answer_is_the_one_that_was_looked_at(
    answers: dict[str, str], question: str, tmp_path: Path
) -> None:
    seen = SEEN / f"{question.replace(' --', '.')}{'' if '--json' in question else '.txt'}"
    (tmp_path / seen.name).write_text(answers[question], "utf-8")
    expected = seen.read_text("utf-8") if seen.exists() else ""
    assert NUMBER.split(answers[question]) == NUMBER.split(expected), f"what is new: {tmp_path / seen.name}"
    found, wanted = ([*map(float, NUMBER.findall(text))] for text in (answers[question], expected))
    assert found == pytest.approx(wanted, rel=SAME, abs=1e-12), f"what is new: {tmp_path / seen.name}"
