"""Public names are described: what they do, their parameters with shapes and units, and what they return."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest
from rooms import field_docstrings, read_house

ROOT = Path(__file__).parents[2]
HOUSE = read_house(ROOT)
Function = ast.FunctionDef | ast.AsyncFunctionDef


def public_definitions() -> Iterator[tuple[str, Function | ast.ClassDef]]:
    """Yield each function and class in an `__all__` with its definition."""
    homes = set()
    for room in HOUSE.rooms:
        package = import_module(room)
        for name in getattr(package, "__all__", ()):
            homes.add((getattr(getattr(package, name), "__module__", room), name))
    for module, name in sorted(homes):
        for node in HOUSE.trees.get(module, ast.Module([], [])).body:
            if isinstance(node, Function | ast.ClassDef) and node.name == name:
                yield f"{module}.{name}", node


PUBLIC = dict(public_definitions())


def section(docstring: str, title: str) -> str:
    """Return the text of a numpydoc section; empty where there is none."""
    match = re.search(rf"^{title}\n-+\n(.*?)(?=^\w+\n-{{3,}}|\Z)", docstring, re.MULTILINE | re.DOTALL)
    return match[1] if match else ""


def undescribed(function: Function, further: str = "") -> list[str]:
    """Return the parameters of a function that its docstring does not describe, and "return" where that is missing."""
    docstring = (ast.get_docstring(function) or "") + "\n\n" + further
    arguments = function.args
    names = [argument.arg for argument in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)]
    names += [argument.arg for argument in (arguments.vararg, arguments.kwarg) if argument is not None]
    text = section(docstring, "Parameters")
    missing = [name for name in names if not re.search(rf"^[\w*, ]*\b{name}\b", text, re.MULTILINE)]
    returns = function.returns is not None and ast.unparse(function.returns) not in ("None", "NoReturn")
    is_described = section(docstring, "Returns") or section(docstring, "Yields")
    return [
        *(name for name in missing if name not in ("self", "cls")),
        *(["return"] if returns and not is_described else []),
    ]


def parameters(docstring: str) -> set[str]:
    """Return the words that begin a line of the Parameters section."""
    return set(re.findall(r"^\*{0,2}(\w+)", section(docstring, "Parameters"), re.MULTILINE))


def missing_descriptions(node: Function | ast.ClassDef) -> list[str]:
    """Return what the docstrings of a public function or class leave out."""
    if not isinstance(node, ast.ClassDef):
        return undescribed(node)
    described = {name.rpartition(".")[2] for name, _ in field_docstrings(node)}
    own = ast.get_docstring(node) or ""
    fields = [
        item.target.id for item in node.body if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name)
    ]
    missing = [name for name in fields if name[0] != "_" and name not in described | parameters(own)]
    for method in (item for item in node.body if isinstance(item, Function)):
        if method.name == "__init__" or method.name[0] != "_":
            left_out = undescribed(method, own if method.name == "__init__" else "")
            missing += [f"{method.name}({name})" for name in left_out if name != "return"]
    return missing


@pytest.mark.parametrize("name", PUBLIC)
def test_a_public_name_has_a_docstring(name: str) -> None:
    assert ast.get_docstring(PUBLIC[name]), name


def test_parameters_of_public_names_are_described() -> None:
    missing = {name: left_out for name, node in PUBLIC.items() if (left_out := missing_descriptions(node))}
    assert 1 - len(missing) / len(PUBLIC) >= 0.9, missing
