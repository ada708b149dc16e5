"""A command as a person types it, in an empty folder."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from lobewatch.cli import main
from lobewatch.machine.folder import MachineFolder


class Said(NamedTuple):
    """What a command ends with."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> dict[str, Any]:
        """The object on stdout."""
        parsed: dict[str, Any] = json.loads(self.out)
        return parsed


Run = Callable[..., Said]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Run:
    """Runs a command in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def command(*arguments: object) -> Said:
        monkeypatch.setattr(sys, "argv", ["lobewatch", *map(str, arguments)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main()
        code = end.value.code
        return Said(code if isinstance(code, int) else int(code is not None), *capsys.readouterr())

    return command


@pytest.fixture
def trial(run: Run) -> MachineFolder:
    """A machine folder with the example spindle."""
    assert run("init", "trial", "--example").code == 0
    return MachineFolder("trial")


def refused(said: Said, *words: str) -> None:
    """Exit code 2 and one sentence with these words, no traceback, nothing on stdout."""
    assert said.code == 2
    assert said.err.startswith("error: ")
    assert said.err.count("\n") == 1, said.err
    assert said.out == ""
    for word in words:
        assert word in said.err
