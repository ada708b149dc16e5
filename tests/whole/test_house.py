"""The house stays in order: layers without circles, short bodies, names that say what they hold."""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from statistics import mean

import pytest
from rooms import PACKAGES, read_house

from lobewatch.commands import COMMANDS

ROOT = Path(__file__).parents[2]
HOUSE = read_house(ROOT)
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]["contracts"]
DOOR = ("lobewatch.cli", "lobewatch.commands")
"""Entry points, which import modules on demand."""
DOMAIN = ("machine", "measurement", "tool", "verdicts", "cuts", "history", "monitoring", "logbook", "fleet")
"""Rooms that neither print nor draw."""
LIBRARY = (*DOMAIN, "tap", "sensors", "paper")
"""Rooms whose texts name fields of the library; `show`, `screen` and `commands` put the options in their place."""


def bodies(path: Path) -> Iterator[tuple[str, int]]:
    """Functions with the number of lines below their signature and docstring."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[1:2] if ast.get_docstring(node) is not None else node.body[:1]
            start = first[0].lineno if first else (node.end_lineno or 0) + 1
            yield f"{path.relative_to(ROOT)}:{node.name}", (node.end_lineno or 0) - start + 1


@pytest.mark.parametrize("package", PACKAGES)
def test_no_rooms_and_no_files_reach_each_other_in_a_circle(package: str) -> None:
    assert (HOUSE.circles(package), HOUSE.file_circles(package)) == ([], [])


@pytest.mark.parametrize("contract", [one for one in CONTRACTS if one["type"] == "layers"], ids=lambda one: one["name"])
def test_names_are_taken_from_layers_below_also_through_facades(contract: dict[str, list[str]]) -> None:
    container = f"{contract['containers'][0]}." if "containers" in contract else ""
    rank = {
        f"{container}{name}": number
        for number, layer in enumerate(reversed(contract["layers"]))
        for name in layer.split(" | ")
    }

    def layer_of(module: str) -> int | None:
        parts = module.split(".")
        return next((rank[name] for n in range(len(parts)) if (name := ".".join(parts[: n + 1])) in rank), None)

    upwards = [
        f"{one.file} takes {one.name} of {one.target}"
        for one in HOUSE.imports
        if (mine := layer_of(one.file)) is not None and (other := layer_of(one.target)) is not None and mine < other
    ]
    assert upwards == []


def test_the_application_imports_nothing_from_its_own_facade_and_hides_no_import() -> None:
    mine = [one for one in HOUSE.imports if one.file.startswith("lobewatch.")]
    assert [one.file for one in mine if one.target == "lobewatch"] == []
    facade = [
        module
        for module, tree in HOUSE.trees.items()
        for node in ast.walk(tree)
        if module.startswith("lobewatch.") and isinstance(node, ast.ImportFrom) and node.module == "lobewatch"
    ]
    assert facade == []
    assert [f"{one.file}: {one.name}" for one in mine if one.is_hidden and not one.file.startswith(DOOR)] == []


@pytest.mark.parametrize("package", PACKAGES)
def test_no_body_is_longer_than_40_lines(package: str) -> None:
    paths = (ROOT / package).rglob("*.py")
    assert {name: count for path in paths for name, count in bodies(path) if count > 40} == {}


def test_no_class_name_has_two_meanings() -> None:
    assert {name: modules for name, modules in HOUSE.classes.items() if len(modules) > 1} == {}


def test_names_and_docstrings_of_the_application_say_what_is_held() -> None:
    lines = sum(HOUSE.lines("lobewatch").values())
    assert 1000 * len(HOUSE.generic_names("lobewatch")) / lines <= 15
    assert HOUSE.share_without_noun("lobewatch") <= 0.04


def test_commands_only_parse_and_show() -> None:
    lines = HOUSE.lines("lobewatch")
    others = ("lobewatch.commands", "lobewatch.commands.help_page", "lobewatch.commands.shared_options")
    commands = [count for name, count in lines.items() if name.startswith("lobewatch.commands") and name not in others]
    assert mean(commands) <= 70  # half of it options


@pytest.mark.parametrize("room", DOMAIN)
def test_the_domain_never_prints(room: str) -> None:
    for path in (ROOT / "lobewatch" / room).rglob("*.py"):
        names = {node.id for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, ast.Name)}
        assert not names & {"print", "Console"}, path


OPTION = re.compile(rf"(?<![\w-])--[a-z][\w-]+|\blobewatch (?:{'|'.join(COMMANDS)})\b")
"""An option or a command of the command line."""


@pytest.mark.parametrize(
    "package", ["acquisition", "modal", "dsm", "lobes", *(f"lobewatch/{room}" for room in LIBRARY)]
)
def test_the_library_names_no_option_and_no_command(package: str) -> None:
    named = [
        f"{path.relative_to(ROOT)}: {text}"
        for path in sorted((ROOT / package).rglob("*.py"))
        for text in texts(ast.parse(path.read_text("utf-8")))
        if OPTION.search(text)
    ]
    assert named == []


def texts(tree: ast.Module) -> Iterator[str]:
    """Yield the string constants of a module that are no docstrings."""
    documented = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documented:
            yield node.value
