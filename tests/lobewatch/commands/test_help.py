"""Help fits every terminal, and its examples can be copied and are accepted."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

import lobewatch.commands
from lobewatch.cli import app, main
from lobewatch.commands import COMMANDS, GROUPS

PAGES = ["", *COMMANDS, "emulate taps", "emulate dataq"]


def page(name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> str:
    monkeypatch.setattr(sys, "argv", ["lobewatch", *name.split(), "--help"])
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("columns", [40, 60, 80, 120])
@pytest.mark.parametrize("name", PAGES)
def test_help_wraps_at_any_width_and_nothing_is_cut_off(
    name: str, columns: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    text = page(name, monkeypatch, capsys)
    for line in text.splitlines():
        assert len(line) <= columns or line.startswith("  lobewatch "), line
    assert not set(text) & set("…│╭╰\x1b\\")
    monkeypatch.setenv("COLUMNS", "100")
    assert "".join(text.split()) == "".join(page(name, monkeypatch, capsys).split())


@pytest.mark.parametrize("name", PAGES[1:])
def test_each_example_stands_on_a_line_and_is_accepted(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    lines = page(name, monkeypatch, capsys).splitlines()
    examples = [line for line in lines if line.startswith("  lobewatch ")]
    assert ("Examples:" in lines) is bool(examples) is (name != "emulate")
    for example in examples:
        _, *words = shlex.split(example, comments=True)
        accept(typer.main.get_command(app), words)


def accept(command: Any, words: list[str]) -> None:
    """Parse a command line without running it; SystemExit or an error of usage where it is wrong."""
    with command.make_context("lobewatch", list(words)) as context:
        if isinstance(command, typer.core.TyperGroup):
            _, below, rest = command.resolve_command(context, words)
            accept(below, rest)


def test_the_list_of_commands_stands_under_their_groups(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    lines = page("", monkeypatch, capsys).splitlines()
    below = {group: lines[lines.index(f"{group}:") + 1 :] for group in GROUPS}
    listed = {
        group: [line.split()[0] for line in rest[: (*rest, "").index("")] if line[2] != " "]
        for group, rest in below.items()
    }
    assert listed == {group: list(names) for group, names in GROUPS.items()}


@pytest.mark.quick
def test_the_list_of_commands_is_that_of_the_modules_and_says_what_they_say() -> None:
    folder = Path(lobewatch.commands.__file__).parent
    assert set(COMMANDS) == {file.stem for file in folder.glob("*.py")} - {
        "__init__",
        "shared_options",
        "help_page",
        "verbosity",
    }
    group = typer.main.get_group(app)
    for name, summary in COMMANDS.items():
        assert (group.commands[name].help or "").splitlines()[0] == summary
