"""Hits of a live tap test: undo, recheck, verdicts before storage, a slow disk."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from acquisition import (
    Block,
    Channel,
    HammeredStructure,
    Hammering,
    HitFlags,
    Structure,
    TapsEmulator,
    TapsSource,
    compute_cross_spectra,
    estimate_frf,
    evaluate_hit,
    read_hits,
    read_tap,
    write_hit,
)
from acquisition.estimation.estimate_frf import estimate_frf_from_spectra
from acquisition.hit_quality.evaluate_hit import evaluate_spectrum
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.live_curves import build_curves
from lobewatch.tap.session import TapSession
from lobewatch.tap.state import TapState, TapStep

RATE = 25600.0
Tapper = Callable[..., HammeredStructure]
Pair = tuple[Channel, Channel]
Simulate = Callable[..., Any]
"""Makes the device of conftest.py."""
OpenSession = Callable[..., TapSession]


def test_undo_takes_back_the_last_good_hits_one_by_one_and_the_last_one_too(
    folder: MachineFolder, tapper: Tapper, channels: Pair, simulated: Simulate, session_of: OpenSession
) -> None:
    asked: set[int] = set()

    def watch(state: TapState) -> None:
        for good, times in ((3, 2), (10, 1)):
            if state.good == good and good not in asked:
                asked.add(good)
                for _ in range(times):
                    session.undo()

    session = session_of(folder, lambda: simulated(tapper(), channels), watch)
    tap = session.run()
    undone = [i for i, flags in enumerate(tap.flags, 1) if flags is HitFlags.UNDONE]
    assert undone == [2, 3, 12]
    assert [hit.number for hit in session.state.hits if hit.undone] == undone
    assert len(tap.accepted) == 10
    assert np.array_equal(tap.required_frf.receptance, estimate_frf(tap.accepted).receptance)
    path = folder.path / "taps" / f"{tap.id}.h5"
    assert read_tap(path).flags == tap.flags
    assert len(read_hits(path)) == 10


def test_good_is_not_reported_of_a_hit_withdrawn(
    folder: MachineFolder, tapper: Tapper, channels: Pair, simulated: Simulate, session_of: OpenSession
) -> None:
    def watch(state: TapState) -> None:
        states.append(state)
        if state.word is TapStep.GOOD and state.good == len(state.hits) == 3:
            session.undo()

    states: list[TapState] = []
    session = session_of(folder, lambda: simulated(tapper(), channels), watch)
    session.run()
    undone = [state for state in states if state.verdict == "undone"]
    assert re.findall(r"\d+", undone[0].reason) == ["3"]
    assert {state.word for state in undone} <= {TapStep.WAIT, TapStep.TAP}


def test_a_first_hit_at_another_spot_is_found_out_by_those_after_it(
    folder: MachineFolder,
    tapper: Tapper,
    structure: Structure,
    channels: Pair,
    simulated: Simulate,
    session_of: OpenSession,
) -> None:
    spot = replace(structure, stiffness=structure.stiffness * np.array([1.0, 1.5, 1.0]))
    how = Hammering(double_hits=0.0, overloads=0.0)
    astray = HammeredStructure(spot, RATE, np.random.default_rng(3), how)
    devices = iter(
        (simulated(astray, channels, unplugged=lambda: session.state.good == 1), simulated(tapper(), channels))
    )
    states: list[TapState] = []
    session: TapSession = session_of(folder, lambda: next(devices), states.append)
    tap = session.run()
    assert tap.flags == (HitFlags.INCONSISTENT, *[HitFlags.OK] * 10)
    told = next(state for state in states if state.verdict == "inconsistent")
    assert (told.good, len(told.hits), told.word) == (3, 4, TapStep.WAIT)
    assert re.match(r"\D*1\D.* \d+ ?%", told.reason)
    assert np.array_equal(tap.required_frf.receptance, estimate_frf(tap.hits[1:]).receptance)


def test_a_verdict_does_not_wait_for_the_disk_and_counts_once_it_is_there(
    folder: MachineFolder,
    tapper: Tapper,
    channels: Pair,
    monkeypatch: pytest.MonkeyPatch,
    simulated: Simulate,
    session_of: OpenSession,
) -> None:
    shown: list[tuple[TapStep, str, int]] = []

    def keep(*arguments: Any) -> None:
        shown.append((session.state.word, session.state.verdict, session.state.good))
        write_hit(*arguments)

    monkeypatch.setattr("lobewatch.tap.tap_in_progress.write_hit", keep)
    session = session_of(folder, lambda: simulated(tapper(), channels))
    session.run()
    assert shown == [(TapStep.GOOD, "good", good) for good in range(10)]


def failing_at(calls: set[int], function: Callable[..., Any]) -> Callable[..., Any]:
    """Make a function that fails at some of its calls, counted from 1."""
    count = iter(range(1, 1000))

    def called(*arguments: Any) -> Any:
        if next(count) in calls:
            raise ZeroDivisionError("Weights sum to zero")
        return function(*arguments)

    return called


def test_a_hit_on_which_the_judging_fails_is_rejected_and_kept_and_the_test_goes_on(
    folder: MachineFolder,
    tapper: Tapper,
    channels: Pair,
    monkeypatch: pytest.MonkeyPatch,
    simulated: Simulate,
    session_of: OpenSession,
) -> None:
    monkeypatch.setattr("lobewatch.tap.tap_in_progress.evaluate_hit", failing_at({3}, evaluate_hit))
    states: list[TapState] = []
    session = session_of(folder, lambda: simulated(tapper(), channels), states.append)
    tap = session.run()
    assert tap.flags == (HitFlags.OK, HitFlags.OK, HitFlags.NOT_EVALUATED, *[HitFlags.OK] * 8)
    refused = next(state for state in states if state.word is TapStep.REFUSED)
    assert refused.shown_word == "NOT JUDGED"
    assert "ZeroDivisionError: Weights sum to zero" in refused.reason
    path = folder.path / "taps" / f"{tap.id}.h5"
    assert read_tap(path).flags == tap.flags
    assert len(read_hits(path)) == 10


def test_a_first_hit_that_cannot_be_compared_with_the_others_counts_no_more(
    folder: MachineFolder,
    tapper: Tapper,
    channels: Pair,
    monkeypatch: pytest.MonkeyPatch,
    simulated: Simulate,
    session_of: OpenSession,
) -> None:
    monkeypatch.setattr(
        "lobewatch.tap.tap_in_progress.evaluate_spectrum", failing_at({2}, evaluate_spectrum)
    )  # the 2nd, looked back at
    tap = session_of(folder, lambda: simulated(tapper(), channels)).run()
    assert tap.flags == (HitFlags.OK, HitFlags.NOT_EVALUATED, *[HitFlags.OK] * 9)


def test_a_hit_without_which_the_mean_fails_is_rejected_and_not_in_it(
    folder: MachineFolder,
    tapper: Tapper,
    channels: Pair,
    monkeypatch: pytest.MonkeyPatch,
    simulated: Simulate,
    session_of: OpenSession,
) -> None:
    module = "acquisition.estimation.estimate_frf.estimate_frf_from_spectra"
    monkeypatch.setattr(module, failing_at({8}, estimate_frf_from_spectra))
    tap = session_of(folder, lambda: simulated(tapper(), channels)).run()
    assert [i for i, flags in enumerate(tap.flags, 1) if flags] == [4]
    assert tap.flags[3] == HitFlags.NOT_EVALUATED
    assert np.array_equal(tap.required_frf.receptance, estimate_frf(tap.accepted).receptance)


def test_curves_that_cannot_be_drawn_end_no_test(
    folder: MachineFolder,
    tapper: Tapper,
    channels: Pair,
    monkeypatch: pytest.MonkeyPatch,
    simulated: Simulate,
    session_of: OpenSession,
) -> None:
    monkeypatch.setattr("lobewatch.tap.hit_loop.build_curves", failing_at({2, 10}, build_curves))
    session = session_of(folder, lambda: simulated(tapper(), channels))
    assert len(session.run().hits) == 10
    assert session.state.plots is None


def test_a_test_on_a_coarse_converter_takes_its_hits_though_some_lines_have_no_force(
    folder: MachineFolder, tapper: Tapper, simulated: Simulate, session_of: OpenSession
) -> None:
    coarse = Channel("force", 2.25e-3, 4.5, 12), Channel("acceleration", 1.02e-3, 5.0, 12)
    tapping = tapper(force_range=(200.0, 200.0), force_noise=0.0)
    tap = session_of(folder, lambda: simulated(tapping, coarse)).run()
    powers = [compute_cross_spectra([hit])[0] for hit in tap.hits]
    assert any(power.min() < 1e-32 * power.max() for power in powers)
    assert tap.flags == (HitFlags.OK,) * 10


def test_no_scan_is_lost_to_a_slow_disk_and_slow_mathematics(
    folder: MachineFolder, tapper: Tapper, channels: Pair, monkeypatch: pytest.MonkeyPatch, session_of: OpenSession
) -> None:
    folder.toml.write_text(folder.toml.read_text("utf-8").replace("hits = 10", "hits = 3"), "utf-8")
    slowed = []

    def slow(function: Callable[..., Any]) -> Callable[..., Any]:
        def late(*arguments: Any) -> Any:
            slowed.append(function.__name__)
            time.sleep(0.5)
            return function(*arguments)

        return late

    monkeypatch.setattr("lobewatch.tap.tap_in_progress.write_hit", slow(write_hit))
    monkeypatch.setattr("lobewatch.tap.hit_loop.build_curves", slow(build_curves))
    lost: list[int] = []

    class Counting(TapsSource):
        def blocks(self) -> Iterator[Block]:
            for block in super().blocks():
                lost.append(block.lost_before)
                yield block

    with TapsEmulator(tapper(), channels, RATE, realtime=True) as device:
        tap = session_of(MachineFolder(folder.path), lambda: Counting(device.port)).run()
    assert slowed.count("write_hit") == slowed.count("build_curves") == len(tap.hits) >= 3
    assert sum(lost) == 0
    assert len(lost) > 3 * 0.4 * RATE / 512
