"""Docstring examples of the functions that take arrays."""

from __future__ import annotations

import doctest
from types import ModuleType

import pytest

from lobewatch.cuts.chatter_detection import cut_detection as find_cut
from lobewatch.cuts.chatter_detection import cut_evaluation as judge_cut


@pytest.mark.parametrize("module", [find_cut, judge_cut])
def test_the_examples_say_what_comes_out(module: ModuleType) -> None:
    result = doctest.testmod(module)
    assert result.failed == 0
    assert result.attempted > 2
