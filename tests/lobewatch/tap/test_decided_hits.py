"""Hits that the operator accepts or rejects during a test: journal, mean, result, restart and undo."""

from __future__ import annotations

import errno
import json
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest

from acquisition import (
    Channel,
    Circumstances,
    DataError,
    HammeredStructure,
    Hammering,
    HitDecision,
    HitFlags,
    SimulatedSource,
    Structure,
    TapTest,
    Trigger,
    capture_hits,
    estimate_frf,
    read_tap,
    read_tap_hits,
)
from acquisition.hit_quality.best_hits import choose_best_hits
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.hit_loop import TapStopped
from lobewatch.tap.session import TapSession
from lobewatch.tap.state import TapState, TapStep
from lobewatch.tap.tap_in_progress import TapInProgress

RATE = 25600.0
Pair = tuple[Channel, Channel]
Simulate = Callable[..., Any]
"""Makes the device of conftest.py."""
OpenSession = Callable[..., TapSession]
Watch = Callable[[TapState], None]


@pytest.fixture
def start(
    folder: MachineFolder, structure: Structure, channels: Pair, simulated: Simulate, session_of: OpenSession
) -> Callable[..., TapSession]:
    """Make a session in which every third hit is overloaded, and the others good."""

    def make(watch: Watch, overloads: float = 0.3) -> TapSession:
        hammering = Hammering(double_hits=0.0, overloads=overloads)
        signal = HammeredStructure(structure, RATE, np.random.default_rng(4), hammering)
        return session_of(folder, lambda: simulated(signal, channels, seconds=200.0), watch)

    return make


def lines(folder: MachineFolder) -> list[tuple[int, str, list[str]]]:
    """Return the decisions in the journal, as they were written."""
    path = folder.path / "journal.jsonl"
    read = map(json.loads, path.read_text("utf-8").splitlines() if path.exists() else [])
    return [(line["hit"], line["decision"], line["codes"]) for line in read if line["kind"] == "hit"]


def first_number(state: TapState, *, good: bool) -> int:
    return next(hit.number for hit in state.hits if good != bool(hit.flags))


class Script:
    """Watch of a session that acts once for each number of good hits."""

    def __init__(self, **actions: Callable[[TapSession, TapState], None]) -> None:
        self._actions = {int(name.removeprefix("at_")): action for name, action in actions.items()}
        self.states: list[TapState] = []
        self.session: TapSession | None = None

    def __call__(self, state: TapState) -> None:
        self.states.append(state)
        due = [good for good in self._actions if state.good >= good and self._has_both(state)]
        if due and self.session is not None:
            self._actions.pop(min(due))(self.session, state)

    @staticmethod
    def _has_both(state: TapState) -> bool:
        return {bool(hit.flags) for hit in state.hits} == {True, False}

    def run(self, start: Callable[..., TapSession]) -> TapTest:
        self.session = start(self)
        return self.session.run()


def accept_first(session: TapSession, state: TapState) -> None:
    session.decide(first_number(state, good=False), accept=True)


def reject_first(session: TapSession, state: TapState) -> None:
    session.decide(first_number(state, good=True), accept=False)


def test_an_accepted_hit_counts_in_the_mean_the_result_and_the_journal(
    folder: MachineFolder, start: Callable[..., TapSession]
) -> None:
    script = Script(at_4=accept_first)
    tap = script.run(start)
    ((number, decision, codes),) = lines(folder)
    assert (decision, tuple(codes)) == ("accept", tap.flags[number - 1].codes)
    assert tap.decisions == (HitDecision(number, "accept", tuple(codes)),)
    assert len(tap.accepted) == tap.required_frf.n_averages == 10
    assert any(tap.hits[number - 1] is hit for hit in tap.accepted)
    shown = script.states[-1].hits[number - 1]
    assert (shown.flags, shown.accepted) == (HitFlags.OK, tap.flags[number - 1])
    stored = read_tap(folder.path / "taps" / f"{tap.id}.h5")
    assert stored.flags == tap.flags
    assert np.array_equal(stored.required_frf.receptance, estimate_frf(tap.accepted).receptance)
    again = MachineFolder(folder.path)
    assert again.read(again.taps()[-1]).decided_flags == tap.decided_flags
    assert {remark.code for remark in Logbook(again).measurement(tap.id).remarks} >= {"hits-by-hand", "hits-overloaded"}


def test_the_later_of_two_decisions_counts(folder: MachineFolder, start: Callable[..., TapSession]) -> None:
    number: list[int] = []

    def accept_again(session: TapSession, _: TapState) -> None:
        session.decide(number[0], accept=True)

    def reject(session: TapSession, state: TapState) -> None:
        number.append(first_number(state, good=True))
        reject_first(session, state)

    tap = Script(at_2=reject, at_3=accept_again, at_5=lambda session, _: session.decide(number[0], accept=False)).run(
        start
    )
    assert lines(folder) == [(number[0], word, []) for word in ("reject", "undo", "reject")]
    assert (tap.flags[number[0] - 1], tap.decided_flags[number[0] - 1]) == (HitFlags.OK, HitFlags.UNDONE)
    assert len(tap.accepted) == 10


@pytest.mark.parametrize(("number", "accept"), [(99, True), (0, False)])
def test_a_decision_on_no_hit_says_so_and_changes_nothing(
    folder: MachineFolder, start: Callable[..., TapSession], number: int, accept: bool
) -> None:
    script = Script(at_2=lambda session, _: session.decide(number, accept=accept))
    tap = script.run(start)
    assert any(f"hit {number} does not exist" in state.reason for state in script.states)
    assert (lines(folder), tap.decisions) == ([], ())


def test_the_last_hit_needs_no_number(folder: MachineFolder, start: Callable[..., TapSession]) -> None:
    numbers: list[int] = []

    def watch(state: TapState) -> None:
        if not numbers and state.word is TapStep.REFUSED and state.hits and state.hits[-1].flags:
            numbers.append(len(state.hits))
            session.decide(None, accept=True)

    session = start(watch)
    session.run()
    assert [line[:2] for line in lines(folder)] == [(numbers[0], "accept")]


def test_undo_of_an_accepted_hit_rejects_it(folder: MachineFolder, start: Callable[..., TapSession]) -> None:
    done: list[int] = []

    def watch(state: TapState) -> None:
        if state.hits and state.hits[-1].accepted and not done:
            done.append(state.hits[-1].number)
            session.undo()
        elif state.hits and state.hits[-1].flags and not done:
            session.decide(len(state.hits), accept=True)

    session = start(watch)
    tap = session.run()
    assert [line[:2] for line in lines(folder)][:2] == [(done[0], "accept"), (done[0], "reject")]
    assert tap.decided_flags[done[0] - 1] & HitFlags.UNDONE


def test_a_restarted_test_keeps_the_decision_on_its_hit_even_if_another_hit_is_damaged(
    folder: MachineFolder, start: Callable[..., TapSession]
) -> None:
    asked: list[int] = []

    def watch(state: TapState) -> None:
        if not asked and state.hits[1:] and state.hits[-1].flags:
            asked.append(len(state.hits))
            session.decide(None, accept=True)
        if any(hit.accepted for hit in state.hits):
            session.stop()

    session = start(watch)
    with pytest.raises(TapStopped):
        session.run()
    (spool,) = folder.spool.iterdir()
    ((number, _, codes),) = lines(folder)
    accepted = read_tap_hits(spool / f"{number - 1:04d}.h5")[0][0]
    assert number > 1
    lost = spool / "0000.h5"
    content = bytearray(lost.read_bytes())
    content[len(content) // 2] ^= 0xFF
    lost.write_bytes(content)
    tap = start(lambda _: None, overloads=0.0).run()
    assert tap.id == spool.name
    (decision,) = tap.decisions
    assert decision.hit == number - 1
    assert decision.codes == tuple(codes)
    assert np.array_equal(tap.hits[decision.hit - 1].force, accepted.force)
    again = MachineFolder(folder.path)
    assert again.taps()[-1].hit_decisions == tap.decisions
    assert again.read(again.taps()[-1]).required_frf.n_averages == 10


def test_more_hits_than_needed_are_all_kept_and_the_best_are_used(
    folder: MachineFolder, start: Callable[..., TapSession]
) -> None:
    script = Script(at_10=accept_first)
    tap = script.run(start)
    ((number, *_),) = lines(folder)
    surplus = [i for i, flags in enumerate(tap.flags) if flags & HitFlags.SURPLUS]
    assert (len(surplus), len(tap.accepted)) == (1, 10)
    assert any(tap.hits[number - 1] is hit for hit in tap.accepted)
    machine_made = [i for i, flags in enumerate(tap.flags) if flags in (HitFlags.OK, HitFlags.SURPLUS)]
    best = [machine_made[k] for k in choose_best_hits([tap.hits[i] for i in machine_made], 9)]
    assert set(machine_made) - set(best) == set(surplus)
    assert script.states[-1].hits[surplus[0]].flags is HitFlags.SURPLUS
    remarks = Logbook(MachineFolder(folder.path)).measurement(tap.id).remarks
    assert [remark.about for remark in remarks if remark.code == "hits-surplus"] == [f"hit {surplus[0] + 1}"]


def test_an_accepted_hit_is_not_excluded_by_those_after_it(folder: MachineFolder, structure: Structure) -> None:
    spot = replace(structure, stiffness=1.5 * structure.stiffness)
    careful = Hammering(double_hits=0.0, overloads=0.0)
    channels = Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0)
    hits = []
    for part, count in ((spot, 1), (structure, 4)):
        source = SimulatedSource(
            HammeredStructure(part, RATE, np.random.default_rng(2), careful), channels, RATE, 90_000
        )
        hits += [*capture_hits(source, Trigger(20.0, 6400, 512))][:count]
    about = Circumstances("m", datetime.now(UTC))
    for decisions, flags in (((), HitFlags.OK), ((HitDecision(1, "accept", ("too-hard",)),), HitFlags.TOO_HARD)):
        tap = TapInProgress("ID", about, folder, hits, [flags, *4 * [HitFlags.OK]], decisions=decisions)
        tap.reasons, tap.numbers = 5 * [""], [*range(5)]
        for hit in hits:
            tap.mean.add(hit)
        assert (tap.recheck_first_hits() is None) == bool(decisions)


def test_nothing_is_shown_that_the_journal_does_not_have(
    folder: MachineFolder, start: Callable[..., TapSession], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise OSError(errno.EIO, "Input/output error", "journal.jsonl")

    monkeypatch.setattr("lobewatch.tap.tap_in_progress.store_hit_decisions", fail)
    script = Script(at_2=accept_first)
    with pytest.raises(DataError):
        script.run(start)
    assert not any(hit.accepted for state in script.states for hit in state.hits)
    monkeypatch.undo()
    assert not Script().run(start).decisions
    assert lines(folder) == []


def test_a_decision_that_cannot_be_stored_leaves_the_mean_as_it_was(
    folder: MachineFolder, structure: Structure, channels: Pair, monkeypatch: pytest.MonkeyPatch
) -> None:
    signal = HammeredStructure(structure, RATE, np.random.default_rng(4), Hammering(double_hits=0.0, overloads=0.0))
    source = SimulatedSource(signal, channels, RATE, 90_000)
    hits = [*capture_hits(source, Trigger(20.0, 6400, 512))][:4]
    tap = TapInProgress("ID", Circumstances("m", datetime.now(UTC)), folder, hits, 4 * [HitFlags.OK])
    tap.flags[3], tap.numbers = HitFlags.TOO_HARD, [*range(4)]
    for hit in hits[:3]:
        tap.mean.add(hit)
    assert tap.mean.frf is not None
    before = tap.mean.frf.receptance

    def fail(*_: object) -> None:
        raise OSError(errno.EIO, "Input/output error", "journal.jsonl")

    monkeypatch.setattr("lobewatch.tap.tap_in_progress.store_hit_decisions", fail)
    for number, accept in ((3, True), (0, False)):
        with pytest.raises(OSError, match="journal"):
            tap.decide(number, accept=accept)
        assert tap.mean.frf is not None
        assert np.array_equal(tap.mean.frf.receptance, before)
        assert (len(tap.mean.hits), tap.decisions) == (3, ())
    monkeypatch.undo()
    tap.decide(3, accept=True)
    assert len(tap.mean.hits) == 4
