"""Trial hits in a live tap test."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Any

import pytest

from acquisition import Channel, HammeredStructure, Hit, HitFlags, check_hit, estimate_decay_time
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.session import TapSession
from lobewatch.tap.state import TapState, TapStep

Tapper = Callable[..., HammeredStructure]
Pair = tuple[Channel, Channel]
Simulate = Callable[..., Any]
"""Makes the device of conftest.py."""
OpenSession = Callable[..., TapSession]


def test_trial_hits_choose_what_is_open_and_do_not_count(
    open_folder: MachineFolder, tapper: Tapper, channels: Pair, simulated: Simulate, session_of: OpenSession
) -> None:
    states: list[TapState] = []
    session = session_of(open_folder, lambda: simulated(tapper(), channels), states.append)
    tap = session.run()
    reasons = [state.reason for state in states]
    assert any("Trial hit 1 " in reason for reason in reasons)
    chosen = next(reason for reason in reasons if "0.25 s" in reason)
    assert re.search(r" [12]\d N\D* 0.25 s, \d\d ", chosen)
    assert next(state for state in states if state.trial).good == 0
    assert (session.state.checks[-1].name, session.state.checks[-1].text) == ("trial hits", chosen)
    assert len(tap.hits) == 10


def test_a_rejected_trial_hit_says_what_is_wrong_with_it(
    open_folder: MachineFolder, tapper: Tapper, channels: Pair, simulated: Simulate, session_of: OpenSession
) -> None:
    states: list[TapState] = []
    double = simulated(tapper(double_hits=1.0), channels, unplugged=lambda: session.state.word is TapStep.REFUSED)
    devices = iter((double, simulated(tapper(), channels)))
    session: TapSession = session_of(open_folder, lambda: next(devices), states.append)
    assert len(session.run().hits) == 10
    refused = next(state for state in states if state.word is TapStep.REFUSED)
    assert (refused.shown_word, refused.reason) == ("DOUBLE HIT, TRIAL HIT", HitFlags.DOUBLE_HIT.cure)


@pytest.mark.parametrize("failing", ["check_hit", "estimate_decay_time"])
def test_a_trial_hit_on_which_the_judging_fails_is_asked_for_again(
    failing: str,
    open_folder: MachineFolder,
    tapper: Tapper,
    channels: Pair,
    monkeypatch: pytest.MonkeyPatch,
    simulated: Simulate,
    session_of: OpenSession,
) -> None:
    function = {"check_hit": check_hit, "estimate_decay_time": estimate_decay_time}[failing]
    failures = iter([ZeroDivisionError("no lines")])

    def once(hit: Hit) -> object:
        for failure in failures:
            raise failure
        return function(hit)

    monkeypatch.setattr(f"lobewatch.tap.trial_hits.{failing}", once)
    states: list[TapState] = []
    session = session_of(open_folder, lambda: simulated(tapper(), channels), states.append)
    assert len(session.run().hits) == 10
    refused = next(state for state in states if state.word is TapStep.REFUSED)
    assert refused.shown_word == "NOT JUDGED, TRIAL HIT"
    assert "ZeroDivisionError: no lines" in refused.reason


def test_a_self_check_that_fails_warns_and_ends_no_test(
    folder: MachineFolder,
    tapper: Tapper,
    channels: Pair,
    monkeypatch: pytest.MonkeyPatch,
    simulated: Simulate,
    session_of: OpenSession,
) -> None:
    def failing(*_: object) -> None:
        raise ZeroDivisionError("no lines")

    monkeypatch.setattr("lobewatch.tap.hit_loop.run_self_check", failing)
    session = session_of(folder, lambda: simulated(tapper(), channels))
    assert len(session.run().hits) == 10
    check = session.state.checks[0]
    assert (check.name, check.passed) == ("self-check", False)
    assert "ZeroDivisionError: no lines" in check.text
