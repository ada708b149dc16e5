"""The API reference: its pages are those of the code, and what its examples show is what comes out."""

from __future__ import annotations

import doctest
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
API = ROOT / "docs" / "api"
PACKAGES = ("acquisition", "modal", "dsm", "lobes")
ROOMS = ("fleet", "history", "logbook", "machine", "measurement", "monitoring", "tool", "verdicts")
MODULES = (*PACKAGES, "lobewatch", *(f"lobewatch.{room}" for room in ROOMS))


def public(module: ModuleType) -> dict[str, Any]:
    """Public names of a package or room."""
    return {name: getattr(module, name) for name in module.__all__}


def examples(module: ModuleType) -> Iterator[tuple[str, doctest.DocTest]]:
    """Examples of each public name, its methods' among them, after `from PACKAGE import *`, as the index page says."""
    names: dict[str, Any] = {"np": np}
    for package in (*map(import_module, PACKAGES), module):
        names |= public(package)
    finder = doctest.DocTestFinder()
    for name, value in public(module).items():
        if callable(value) and value.__module__.startswith(module.__name__):
            yield from ((name, test) for test in finder.find(value, name, globs=names) if test.examples)


@pytest.mark.parametrize("module", MODULES)
def test_examples_show_what_comes_out(module: str) -> None:
    runner = doctest.DocTestRunner(verbose=False, optionflags=doctest.ELLIPSIS)
    for _, test in examples(import_module(module)):
        runner.run(test)
    assert runner.failures == 0


def test_at_least_80_public_names_have_an_example() -> None:
    assert len({(module, name) for module in MODULES for name, _ in examples(import_module(module))}) >= 80


def test_the_packages_do_not_share_a_name() -> None:
    names = [name for package in PACKAGES for name in import_module(package).__all__]
    assert len(names) == len(set(names))


def test_the_pages_are_those_of_the_code(tmp_path: Path) -> None:
    command = [sys.executable, "-W", "error", str(ROOT / "docs" / "make_api.py"), str(tmp_path)]
    subprocess.run(command, check=True, cwd=ROOT)
    made, written = (
        {str(path.relative_to(folder)): path.read_text("utf-8") for path in folder.rglob("*.*") if path.is_file()}
        for folder in (tmp_path, API)
    )
    assert sorted(made) == sorted(written)
    stale = [name for name, text in made.items() if text != written[name]]
    assert stale == [], "run: .venv/bin/python docs/make_api.py"


@pytest.mark.parametrize("page", sorted(API.rglob("*.html")), ids=lambda page: page.stem)
def test_no_public_name_and_no_member_is_without_words(page: Path) -> None:
    silent = re.findall(r'class="headerlink" href="#(.+)"></a>\n(?!<div class="docstring">)', page.read_text("utf-8"))
    assert [name for name in silent if not name.endswith(".__init__")] == []
