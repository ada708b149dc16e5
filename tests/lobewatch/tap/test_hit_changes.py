"""Changes from hit to hit, said during a live tap test."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from acquisition import Channel, HammeredStructure, Hammering, HitFlags, Structure
from acquisition.arrays import Floats
from lobewatch.machine.folder import MachineFolder
from lobewatch.measurement import hit_remarks
from lobewatch.screen.live_feed import encode_tap_state
from lobewatch.show.terminal.terminal_screen import render_state
from lobewatch.tap import hit_loop
from lobewatch.tap.session import TapSession
from lobewatch.tap.state import TapState

RATE = 25600.0
Pair = tuple[Channel, Channel]
Shares = Callable[[int], float]
SPINDLE = Structure(np.array([900.0, 1500.0, 2600.0]), np.full(3, 0.01), np.array([4e8, 3e7, 9e8]))


class ChangingStructure(HammeredStructure):
    """Structure whose frequencies have another factor at each hit."""

    def __init__(self, shares: Shares) -> None:
        super().__init__(SPINDLE, RATE, np.random.default_rng(4), Hammering(double_hits=0.0, overloads=0.0))
        self._shares, self._count = shares, 0

    def _hit(self, scan: float) -> tuple[int, Floats]:
        self.structure = replace(SPINDLE, frequency=SPINDLE.frequency * self._shares(self._count))
        self._count += 1
        return super()._hit(scan)


@pytest.fixture
def run(
    folder: MachineFolder, channels: Pair, simulated: Callable[..., Any], session_of: Callable[..., TapSession]
) -> Callable[[Shares], tuple[TapSession, list[TapState]]]:
    """Return a function that runs a test and returns its session and all states."""

    def run_test(shares: Shares) -> tuple[TapSession, list[TapState]]:
        states: list[TapState] = []
        session = session_of(folder, lambda: simulated(ChangingStructure(shares), channels))
        session.wakes.add(lambda: states.append(session.state))
        session.run()
        return session, states

    return run_test


Run = Callable[[Shares], tuple[TapSession, list[TapState]]]


def codes_by_good(states: list[TapState]) -> dict[int, str]:
    return {state.good: state.hit_change.code for state in states if state.hit_change}


def test_a_drift_is_said_from_the_fourth_or_fifth_hit_on_and_in_the_result(run: Run) -> None:
    session, states = run(lambda number: 1 - 0.0012 * number)
    said = codes_by_good(states)
    assert min(said) in (4, 5)
    assert {*said} == {*range(min(said), 11)}
    assert {*said.values()} == {"hits-drift"}
    assert [remark.code for remark in session.measurement.uncovered][:1] == ["hits-drift"]
    assert states[-1].hit_change is None
    assert states[-1].outcome is not None


def test_two_states_are_said_though_the_hits_of_one_are_rejected(run: Run) -> None:
    session, states = run(lambda number: 1 - 0.015 * (number > 4 and number % 2))
    assert HitFlags.INCONSISTENT in [hit.flags for hit in states[-1].hits]
    assert "hits-two-states" in codes_by_good(states).values()
    assert [remark.code for remark in session.measurement.uncovered][:1] == ["hits-two-states"]


def test_undisturbed_hits_say_nothing(run: Run) -> None:
    session, states = run(lambda _: 1.0)
    assert codes_by_good(states) == {}
    assert session.measurement.uncovered == ()


def test_screens_show_the_change_unless_a_hit_is_rejected(run: Run) -> None:
    _, states = run(lambda number: 1 - 0.0012 * number)
    state = next(state for state in states if state.hit_change)
    assert state.hit_change is not None
    shown = json.loads(encode_tap_state(state))["hit_change"]
    assert shown == {"code": "hits-drift", "text": str(state.hit_change)}
    console = Console(width=400, record=True, file=io.StringIO())
    console.print(render_state(replace(state, reason=""), muted=False))
    assert str(state.hit_change) in console.export_text()
    console.print(render_state(replace(state, reason="rejected"), muted=False))
    assert str(state.hit_change) not in console.export_text()


def test_a_failed_comparison_ends_no_test(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise ArithmeticError

    monkeypatch.setattr(hit_loop, hit_remarks.find_hit_remarks.__name__, fail)
    session, states = run(lambda number: 1 - 0.0012 * number)
    assert codes_by_good(states) == {}
    assert session.measurement.uncovered
