"""docs/architecture.md matches the code: folders, layers, nouns."""

from __future__ import annotations

import ast
import re
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
PACKAGES = ("acquisition", "modal", "dsm", "lobes", "lobewatch", "sim_data")
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]


def rooms() -> dict[str, str]:
    """First line of each room's docstring."""
    found = {}
    for package in PACKAGES:
        for file in (ROOT / package).rglob("__init__.py"):
            said = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8")))
            assert said, f"{file} has no docstring"
            found[f"{file.parent.relative_to(ROOT).as_posix()}/"] = said.splitlines()[0]
    return found


def test_the_rooms_are_those_of_the_tree_in_the_words_of_their_docstrings() -> None:
    assert dict(re.findall(r"^\| `([\w/]+/)` \| (.+) \|$", PAGE, re.MULTILINE)) == rooms()


def test_every_folder_of_modules_is_a_room() -> None:
    folders = {file.parent for package in PACKAGES for file in (ROOT / package).rglob("*.py")}
    assert {f"{folder.relative_to(ROOT).as_posix()}/" for folder in folders} == rooms().keys()


@pytest.mark.parametrize("contract", [one for one in CONTRACTS if one["type"] == "layers"], ids=lambda one: one["name"])
def test_the_layers_are_those_that_are_checked(contract: dict[str, list[str]]) -> None:
    where = f"in `{contract['containers'][0].replace('.', '/')}/`" if "containers" in contract else "all of it"
    assert f"* {where}: `{' > '.join(contract['layers'])}`\n" in PAGE


def test_the_nouns_are_public_names_of_where_they_are_reported_to_be() -> None:
    nouns = re.findall(r"^\| `(\w+)` \| `([\w.]+)` \| .+ \| .+ \|$", PAGE, re.MULTILINE)
    assert {"TapTest", "Logbook", "Assembly", "Verdict", "MachineStatus"} <= {name for name, _ in nouns}
    for name, package in nouns:
        assert isinstance(getattr(import_module(package), name), type), name
        assert name in import_module(package).__all__, name


def test_every_place_to_look_is_there() -> None:
    table = PAGE.partition("## Where to look")[2].partition("## Rooms")[0]
    places = re.findall(r"`([a-z_]+/[\w/.]*)`", table)
    assert len(places) > 60
    assert [place for place in places if "NAME" not in place and not (ROOT / place).exists()] == []
