"""The peers of the benchmark of the lobes work out the same multipliers, as exactly as their intervals allow."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

BENCH = Path(__file__).parents[2] / "bench" / "bench_lobes.py"
SPEEDS, DEPTHS = np.array([7000.0, 15000.0]), np.array([1e-4, 1e-3])


@pytest.fixture(scope="module")
def bench() -> ModuleType:
    spec = importlib.util.spec_from_file_location(BENCH.stem, BENCH)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_peers_of_one_mode_come_to_the_same(bench: ModuleType) -> None:
    exact = bench.finest(bench.X, None, SPEEDS, DEPTHS)
    coarse = bench.textbook(bench.X, None, SPEEDS, DEPTHS)
    assert coarse == pytest.approx(exact, rel=0.03)
    assert bench.batched(SPEEDS, DEPTHS, bench.M) == pytest.approx(coarse, rel=1e-6)
    assert bench.batched(SPEEDS, DEPTHS, bench.FINE) == pytest.approx(exact, rel=3e-4)


def test_the_textbook_loop_takes_modes_in_both_directions(bench: ModuleType) -> None:
    exact = bench.finest(*bench.FOUR, SPEEDS, DEPTHS)
    assert bench.textbook(*bench.FOUR, SPEEDS, DEPTHS) == pytest.approx(exact, rel=0.05)
