"""README tells the truth: its commands run and print what stands there, and no command or option is left out."""

from __future__ import annotations

import inspect
import re
import shutil
import sys
import tomllib
from collections.abc import Iterator
from datetime import datetime, tzinfo
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, get_origin

import pytest
import typer

import acquisition
import dsm
import lobes
import modal
from lobewatch.cli import app, main
from lobewatch.tap import demo as stories

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


class December(datetime):
    """The clock by which README was written; what it makes are plain times."""

    def __new__(cls, *parts: Any, **named: Any) -> Any:
        """Return a plain time, as encoders of times know no other type."""
        return datetime(*parts, **named)  # noqa: DTZ001

    @classmethod
    def now(cls, tz: tzinfo | None = None) -> Any:
        """Return a fixed time."""
        return cls(2025, 12, 20, tzinfo=tz)


def commands(group: typer.core.TyperGroup, prefix: str = "") -> Iterator[tuple[str, set[str]]]:
    """Every command with its options."""
    for name, command in group.commands.items():
        if isinstance(command, typer.core.TyperGroup):
            yield from commands(command, f"{prefix}{name} ")
        else:
            yield f"{prefix}{name}", {option for parameter in command.params for option in parameter.opts}


def test_the_page_of_all_commands_is_what_they_say() -> None:
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        page = import_module("make_commands").page()
    finally:
        sys.path.pop(0)
    written = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    assert written == page, "run: .venv/bin/python docs/make_commands.py"


def test_every_command_and_option_is_in_the_docs_and_no_other_in_readme() -> None:
    group = typer.main.get_command(app)
    assert isinstance(group, typer.core.TyperGroup)
    known = dict(commands(group))
    assert len(known) >= 32
    page = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    for name, options in known.items():
        section = page.partition(f"## `lobewatch {name}`")[2].partition("\n## ")[0]
        for option in options:
            assert not option.startswith("--") or f"`{option}" in section or f"/{option}" in section, (name, option)
    mentioned = set(re.findall(r"--[a-z][a-z0-9-]+", re.sub(r"`pip [^`]*`", "", README)))
    assert mentioned <= {"--debug", "--help"}.union(*known.values())
    assert set(re.findall(r"`lobewatch ([a-z]+)", README)) <= {name.split()[0] for name in known}


def test_readme_is_short_and_names_ten_commands() -> None:
    assert len(README.splitlines()) <= 150
    assert len(re.findall(r"^\| `lobewatch ", README, re.MULTILINE)) == 10


def shown(command: str, page: str = README) -> str:
    """Return the output shown below a command in README or another page."""
    block = re.search(rf"^\$ {re.escape(command)}\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    assert block is not None
    return block[1]


def test_the_modes_of_the_beam_are_what_the_command_prints(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "argv", ["lobewatch", "modes", "tests/data/ladisk_beam/acceleration.lvm"])
    with pytest.raises(SystemExit):
        main()
    printed = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    page = (ROOT / "docs" / "modal.md").read_text(encoding="utf-8")
    *wanted, more = shown("python3 run.py modes tests/data/ladisk_beam/acceleration.lvm", page).splitlines()
    assert more == "..."
    assert printed[: len(wanted)] == wanted


@pytest.mark.timeout(300)
def test_the_demo_in_readme_is_what_the_commands_print(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(stories, "datetime", December)
    for command in ("python3 run.py", "python3 run.py check lobewatch-demo"):
        monkeypatch.setattr(sys, "argv", ["lobewatch", *(command.split()[2:] or ["demo"])])
        with pytest.raises(SystemExit):
            main()
        printed = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
        wanted = shown(command).splitlines()
        split = wanted.index("...")
        assert printed[:split] == wanted[:split]
        assert printed[-len(wanted) + split + 1 :] == wanted[split + 1 :]


def test_the_python_in_readme_runs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path, beam: Path
) -> None:
    block = re.search(r"^```python\n(.*?)^```", README, re.MULTILINE | re.DOTALL)
    assert block is not None
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["lobewatch", "init", "mill-3", "--example"])
    with pytest.raises(SystemExit):
        main()
    shutil.copy(beam, "hit.lvm")
    capsys.readouterr()
    exec(block[1], {})
    first, *programs, last = capsys.readouterr().out.splitlines()
    assert "696 Hz" in first
    assert [line.split(":")[0] for line in programs] == ["A", "B", "C"]
    assert all(re.search(r" (stable|doubtful|not stable) \d+\.\d\d mm$", line) for line in programs)
    assert last.split()[0] in ("good", "warn", "alarm")


def test_pictures_and_links_are_there() -> None:
    for page in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md")):
        for link in re.findall(r"\]\(([^)#]+)\)", page.read_text(encoding="utf-8")):
            assert link.startswith("https://") or (page.parent / link).exists(), (page, link)


@pytest.mark.parametrize("package", [acquisition, modal, dsm, lobes], ids=lambda package: package.__name__)
def test_packages_are_ours_and_their_names_are_sorted_and_documented(package: object) -> None:
    name = package.__name__  # type: ignore[attr-defined]
    assert Path(package.__file__).parent == ROOT / name  # type: ignore[attr-defined]
    names = package.__all__  # type: ignore[attr-defined]
    by_kind = sorted(names, key=lambda name: (not name.isupper(), name[0].islower(), name))
    assert names in (by_kind, sorted(names))
    for exported in names:
        value = getattr(package, exported)
        assert inspect.getdoc(value) or get_origin(value) is Literal or exported.isupper(), exported


def test_the_changelog_knows_the_version() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["version"]
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"## [{version}] - 20" in changelog
