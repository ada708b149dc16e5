"""The examples of the API show the true results."""

from __future__ import annotations

import doctest
from collections.abc import Iterator
from importlib import import_module
from types import ModuleType
from typing import Any

import numpy as np
import pytest

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
