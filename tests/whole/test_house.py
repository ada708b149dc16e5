"""The house stays tidy: small rooms, short files, short bodies, commands that only parse and show."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from statistics import mean

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = ("acquisition", "modal", "dsm", "lobes", "lobewatch")
FLAT = {"modal": 26, "lobes": 31, "lobewatch/commands": 29}
"""Folders that may hold more than twenty files, and how many."""
WHOLE = (*PACKAGES, "tests")


def sources(package: str) -> list[Path]:
    return [path for path in (ROOT / package).rglob("*.py") if "plugins" not in path.parts]


def lines(path: Path) -> int:
    return len(path.read_text("utf-8").splitlines())


def bodies(path: Path) -> Iterator[tuple[str, int]]:
    """Functions with the number of lines below their signature and docstring."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[1:2] if ast.get_docstring(node) is not None else node.body[:1]
            start = first[0].lineno if first else (node.end_lineno or 0) + 1
            yield f"{path.relative_to(ROOT)}:{node.name}", (node.end_lineno or 0) - start + 1


@pytest.mark.parametrize("package", WHOLE)
def test_no_folder_holds_more_than_twenty_files(package: str) -> None:
    count: dict[str, int] = {}
    for path in sources(package):
        name = path.parent.relative_to(ROOT).as_posix()
        count[name] = count.get(name, 0) + 1
    assert {name: n for name, n in count.items() if n > FLAT.get(name, 20)} == {}


def test_no_file_of_the_application_is_longer_than_250_lines() -> None:
    assert {str(path.relative_to(ROOT)): lines(path) for path in sources("lobewatch") if lines(path) > 250} == {}


@pytest.mark.parametrize("package", PACKAGES)
def test_no_body_is_longer_than_40_lines(package: str) -> None:
    assert {name: n for path in sources(package) for name, n in bodies(path) if n > 40} == {}


def test_commands_only_parse_and_show() -> None:
    commands = [path for path in sources("lobewatch/commands") if path.name not in ("__init__.py", "help_page.py")]
    assert mean(map(lines, commands)) <= 65


@pytest.mark.parametrize(
    "room", ["machine", "measuring", "tool", "verdicts", "cuts", "history", "decay", "logbook", "plant"]
)
def test_the_domain_never_prints(room: str) -> None:
    for path in sources(f"lobewatch/{room}"):
        names = {node.id for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, ast.Name)}
        assert not names & {"print", "Console"}, path
