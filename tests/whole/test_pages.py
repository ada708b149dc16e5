"""The pages of docs: none is an orphan, commands and options on them exist, their Python runs."""

from __future__ import annotations

import re
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import typer

from lobewatch.cli import app

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md") if path.name != "commands.md")


def shown_commands(page: Path) -> Iterator[str]:
    """Yield the commands after each prompt."""
    text = page.read_text("utf-8").replace("\\\n", " ")
    for line in re.findall(r"^ *\$ (?:python3 run\.py|lobewatch) ?(.*)$", text, re.MULTILINE):
        yield line.partition(" # ")[0]
    for line in re.findall(r"`lobewatch ([a-z]+ [^`]*)`", text):
        yield line


def command_of(words: list[str]) -> tuple[str, set[str]]:
    """Return the name of the called command, and its options."""
    group = typer.main.get_command(app)
    name = words[0] if words else "demo"
    command = group.commands[name]  # type: ignore[attr-defined]
    if hasattr(command, "commands") and len(words) > 1 and words[1] in command.commands:
        command = command.commands[words[1]]
    return name, {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}


@pytest.mark.parametrize("page", [ROOT / "README.md", *PAGES], ids=lambda page: page.stem)
def test_commands_on_the_page_exist_with_their_options(page: Path) -> None:
    for line in shown_commands(page):
        words = shlex.split(line.replace("...", ""), posix=True)
        name, options = command_of(words)
        given = {word.partition("=")[0] for word in words if re.match(r"--?[a-z]", word)}
        assert given <= options | {"--help", "--debug", "--version"}, (name, line)


@pytest.mark.parametrize("page", ["modal", "tutorials/researcher"])
def test_python_on_the_page_runs(
    page: str, beam: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(beam, "hits.lvm")
    time = np.arange(6400) / 25600.0
    decay = np.exp(-0.02 * 2 * np.pi * 800 * time) * np.cos(2 * np.pi * 800 * time)
    names = {"decays": np.outer([300.0, 400.0, 200.0], decay), "sample_rate": 25600.0}
    blocks = re.findall(r"^```python\n(.*?)^```", (DOCS / f"{page}.md").read_text("utf-8"), re.MULTILINE | re.DOTALL)
    assert blocks
    for block in blocks:
        exec(block, names)
        assert re.search(r"69[56]|800\.15998", capsys.readouterr().out)
