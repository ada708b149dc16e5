"""`run.py bench`: peers solve the same task, the page shows the measurements, slowdowns are reported."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import performance
import pytest
from bench_lobes import DEPTHS, FOUR, SPEEDS, Modes, X, batched, textbook
from performance import BENCHES, PAGE, ROOT, STATED, page, races, read_stated, worse
from race import Race, Result, run

from lobes import Cut, spectral_radius


def result(question: str, times: float) -> Result:
    return Result(question, 0.5, "a peer", 0.5 * times, times, 0.9 * times, 1.1 * times)


def test_the_page_is_that_of_the_last_run() -> None:
    stated = read_stated(STATED)
    assert PAGE.read_text("utf-8") == page(stated), "python3 run.py bench writes both"
    assert list(stated.results) == list(BENCHES)


def test_what_got_slower_is_reported_and_nothing_else() -> None:
    before = [result("a", 4.0), result("b", 4.0), result("gone", 1.0)]
    (line,) = worse([result("a", 2.9), result("b", 3.1), result("new", 0.1)], before)
    assert line == "got slower: a: 2.9 times as fast as a peer, stated 4"


def test_a_part_of_the_work_of_a_peer_counts_for_all_of_it() -> None:
    def work() -> None:
        sum(range(30_000))

    whole, part = (run(Race("", work, "", work, rounds=9, part=share)) for share in (1.0, 0.02))
    assert part.times == pytest.approx(50 * whole.times, rel=0.9)
    assert part.least <= part.times <= part.most


def test_processes_that_are_started_count() -> None:
    busy = [sys.executable, "-c", "sum(range(3_000_000))"]
    raced = run(Race("", lambda: subprocess.run(busy, check=True), "", lambda: None, rounds=1))
    assert raced.times < 0.01


@pytest.mark.parametrize("modes", [(X, None), FOUR])
def test_the_textbook_loop_comes_to_the_same_multipliers(modes: tuple[Modes, Modes]) -> None:
    speeds, depths, cut = SPEEDS[60::120], DEPTHS[:8:3], Cut(2, 1.0, "down", 6e8, 2e8)
    ours = spectral_radius(*modes, cut, speeds, depths)
    for loop in (1, 3):
        assert np.max(np.abs(textbook(*modes, speeds, depths, loop) / ours - 1)) < 0.025
    if modes[1] is None:
        assert np.max(np.abs(batched(speeds, depths, 640) / ours - 1)) < 1e-3


def test_a_race_runs_and_is_reported(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "argv", ["performance.py", "--quick", "Tap files"])
    before = PAGE.read_bytes(), STATED.read_bytes()
    performance.main()
    assert "x  tap test stored, 10 hits, compared with h5py" in capsys.readouterr().out
    assert (PAGE.read_bytes(), STATED.read_bytes()) == before


def test_a_peer_that_is_not_installed_is_reported(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "sdypy", None)
    monkeypatch.delitem(sys.modules, "bench_modal", raising=False)
    assert list(races("Modes")) == []
    assert "Modes: left out from here on, sdypy is not installed" in capsys.readouterr().err
