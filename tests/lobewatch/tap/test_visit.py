"""Visit to a machine: x, then y, then the operator's choice."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import pytest

from acquisition import Circumstances, HammeredStructure, TapDirection
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap import session
from lobewatch.tap.hit_loop import TapStopped
from lobewatch.tap.session import TapSession, build_outcome
from lobewatch.tap.state import Outcome, TapState, TapStep
from lobewatch.tap.visit import TapVisit, choose_first_direction


class Visit:
    """Visit to a machine that taps itself, in a thread of its own, as an operator sees it."""

    def __init__(
        self, folder: MachineFolder, simulated: Any, tapper: Any, channels: Any, *, leads: bool = True
    ) -> None:
        self._folder, self._device = folder, lambda: simulated(tapper(), channels)
        self.planned: list[tuple[str, str]] = []
        self.words: list[str] = []
        self.visit = TapVisit(self._plan, "reference", leads=leads, after=lambda _: None)
        self.visit.wakes.add(self._note)
        self.error: BaseException | None = None
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _plan(self, tool: str, direction: TapDirection) -> TapSession:
        self.planned.append((tool, direction))
        about = Circumstances("m", datetime.now(UTC), tool, direction)
        return TapSession(self._folder, self._device, about, sleep=lambda _: None)

    def _run(self) -> None:
        try:
            self.visit.run()
        except TapStopped as error:
            self.error = error

    def _note(self) -> None:
        if self.visit.state.word not in self.words[-1:]:
            self.words.append(self.visit.state.word)

    def wait(self, done: Callable[[TapState], object]) -> TapState:
        woken = threading.Event()
        self.visit.wakes.add(woken.set)
        while not done(self.visit.state):
            assert woken.wait(30)
            woken.clear()
        return self.visit.state

    def end(self) -> None:
        self._thread.join(30)
        assert not self._thread.is_alive()


@pytest.fixture
def visit(
    folder: MachineFolder,
    simulated: Any,
    tapper: Callable[..., HammeredStructure],
    channels: Any,
) -> Callable[..., Visit]:
    text = folder.toml.read_text("utf-8").replace("hits = 10 ", "hits = 3 ")
    folder.toml.write_text(text, "utf-8")
    return lambda **options: Visit(MachineFolder(folder.path), simulated, tapper, channels, **options)


def keys(state: TapState) -> list[str]:
    return [choice.key for choice in state.choices]


def test_x_then_y_then_the_next_tool(visit: Callable[..., Visit], folder: MachineFolder) -> None:
    person = visit()
    moved = person.wait(lambda state: state.choices)
    assert (moved.word, keys(moved)) == (TapStep.MOVE, ["y", "done"])
    assert all(fact in moved.reason for fact in ("x is saved", "tap y"))
    assert moved.outcome is None
    with pytest.raises(ValueError, match="'x'"):
        person.visit.choose("x")
    person.visit.undo()  # that test is saved
    person.visit.choose("y")
    end = person.wait(lambda state: state.choices and state.word is TapStep.DONE)
    assert keys(end) == ["x", "y", "tool", "done"]
    assert end.outcome is not None
    assert next(word.program for word in end.outcome.programs) == "A: slot at 12 600 rpm (12600 rpm, 2.5 mm)"
    assert {word.word for word in end.outcome.programs} <= {"stable", "doubtful", "not stable"}
    with pytest.raises(ValueError, match=r"machine\.toml"):
        person.visit.choose("tool", " ")
    person.visit.choose("tool", "drill 8")
    assert keys(person.wait(lambda state: state.word is TapStep.MOVE)) == ["y", "done"]
    person.visit.choose("done")
    person.end()
    assert person.planned == [("reference", "x"), ("reference", "y"), ("drill 8", "x")]
    assert [(tap.tool, tap.direction) for tap in Logbook(folder).taps] == person.planned
    assert (person.visit.state.word, person.visit.state.choices) == (TapStep.DONE, ())
    assert person.visit.state.outcome is not None


def test_a_sensor_that_feels_both_axes_is_not_moved(
    folder: MachineFolder, simulated: Any, tapper: Callable[..., HammeredStructure], channels: Any
) -> None:
    folder.toml.write_text(folder.toml.read_text("utf-8").replace("hits = 10 ", "hits = 3 "), "utf-8")
    sensors = [channels[0], *(replace(channels[1], direction=direction) for direction in "xy")]

    def felt() -> HammeredStructure:
        return replace(tapper(), cross_structures=[tapper().structure])

    person = Visit(MachineFolder(folder.path), simulated, felt, tuple(sensors))
    moved = person.wait(lambda state: state.choices)
    assert (moved.word, moved.shown_word) == (TapStep.MOVE, "MOVE HAMMER")
    assert all(fact in moved.reason for fact in ("xy", "3 hits", "tap y"))
    person.visit.choose("y")
    end = person.wait(lambda state: state.choices and state.word is TapStep.DONE)
    assert end.shown_word == "DONE"
    assert sorted(check.name for check in moved.checks if check.name.startswith("acceleration")) == [
        "acceleration x sensor",
        "acceleration y sensor",
    ]
    person.visit.choose("done")
    person.end()
    assert [tap.direction for tap in Logbook(folder).taps] == ["x", "xy", "y"]


def test_a_tap_across_is_offered_where_it_would_settle_something(
    visit: Callable[..., Visit], monkeypatch: pytest.MonkeyPatch
) -> None:
    def asks(*about: Any) -> Outcome:
        return build_outcome(*about)._replace(needs_cross_tap=True)

    monkeypatch.setattr(session, "build_outcome", asks)
    person = visit()
    person.wait(lambda state: state.choices)
    person.visit.choose("y")
    end = person.wait(lambda state: state.choices and state.word is TapStep.DONE)
    assert keys(end) == ["x", "y", "xy", "tool", "done"]
    person.visit.choose("xy")
    assert keys(person.wait(lambda state: state.choices and "direction xy" in state.title)) == [
        "x",
        "y",
        "xy",
        "tool",
        "done",
    ]
    person.visit.choose("done")
    person.end()
    assert person.planned == [("reference", "x"), ("reference", "y"), ("reference", "xy")]


def test_one_test_alone_asks_nothing(visit: Callable[..., Visit]) -> None:
    person = visit(leads=False)
    person.end()
    assert TapStep.MOVE not in person.words
    assert person.planned == [("reference", "x")]


def test_stop_ends_a_visit_between_two_tests_and_a_test_that_runs(visit: Callable[..., Visit]) -> None:
    person = visit()
    person.wait(lambda state: state.choices)
    person.visit.stop()
    person.end()
    assert person.error is None
    again = visit()
    again.visit.stop()
    again.end()
    assert isinstance(again.error, TapStopped)


def test_a_visit_that_was_broken_off_in_y_begins_in_y(visit: Callable[..., Visit], folder: MachineFolder) -> None:
    assert choose_first_direction(folder, "reference") == "x"
    person = visit()
    person.wait(lambda state: state.choices)
    person.visit.choose("y")
    person.wait(lambda state: state.word is not TapStep.MOVE and 0 < state.good < 3)
    person.visit.stop()
    person.end()
    assert choose_first_direction(folder, "reference") == "y"
    assert choose_first_direction(folder, "drill 8") == "x"
