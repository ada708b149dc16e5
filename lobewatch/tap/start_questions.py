"""Ask the person with the hammer whether the spindle stands still."""

import queue
from collections.abc import Callable, Sequence

from acquisition import DataError, Hit
from acquisition.errors import join_sentences
from lobewatch.measurement.recording_questions import SPINDLE_TURNING
from lobewatch.tap.self_check import slice_record
from lobewatch.tap.state import Choice, StatePublisher, TapState, TapStep
from lobewatch.tap.steady_line import find_new_line, find_steady_line, measure_line

START_CHOICE = Choice("start", "Yes, start")
"""Answer that begins a test."""
STILL_CHOICE = Choice("still", "It stands still, continue")
"""Answer to a steady vibration."""

MIN_STEADY_RATIO = 0.8
"""Smallest rms of a steady line in the second half of a record over that in the first; chosen."""


class StartQuestions:
    """Questions before the first hit. `answer` is for every thread, all else for that of the test."""

    def __init__(self, publisher: StatePublisher[TapState], tool: str, accepted: Sequence[str], *, asks: bool) -> None:
        """Ask about a tool. accepted: codes that are answered already. asks: whether a person can answer."""
        self._publisher, self._tool, self._asks = publisher, tool, asks
        self._answers = queue.SimpleQueue[str]()
        self.accepted = list(accepted)
        """Codes of accepted questions."""
        self.asked: list[str] = []
        """Codes of questions that the measurement raised."""
        self.left_open: list[str] = []
        """Codes of questions that the signals after the last hit raised. The finished test asks them."""
        self.is_confirmed = not asks
        """True if the person has confirmed tool and spindle in this session, or nobody can."""

    def answer(self, key: str) -> None:
        """Take the answer to the shown question. ValueError if it is none of its choices."""
        if key not in [choice.key for choice in self._publisher.state.choices]:
            raise ValueError(f"{key!r} is not available now. Use a choice that the page shows.")
        self._answers.put(key)

    def confirm(self, wait: Callable[[], object]) -> None:
        """Ask once whether the spindle is stopped and the tool is in it. wait: reads on for a moment."""
        if self.is_confirmed:
            return
        self._show(f"Is the spindle stopped? Is tool {self._tool} in it?", START_CHOICE)
        while not self._is_answered(START_CHOICE):
            wait()
        self.is_confirmed = True

    def settle(self, baseline: Hit, record: Callable[[], Hit]) -> Hit:
        """Return a record at rest without a line of a turning spindle, or with one that a person has accepted.

        record: makes a new one. DataError if nobody can answer.
        """
        while (line := find_steady_line(baseline)) is not None and line.is_asked:
            self.asked = [SPINDLE_TURNING.code]
            if SPINDLE_TURNING.code in self.accepted:
                return baseline
            if not self._asks:
                answer = "If it stands still, check the accelerometer cable, or add accept_questions.codes"
                answer += f" {SPINDLE_TURNING.code}"
                raise DataError(join_sentences(line.finding, "Stop the spindle and repeat the command", answer))
            self._show(line.text, STILL_CHOICE)
            baseline = record()
            if self._is_answered(STILL_CHOICE):
                self.accepted.append(SPINDLE_TURNING.code)
        self.asked = []
        self._publisher.show(choices=())
        return baseline

    def check_after(self, record: Hit, baseline: Hit) -> None:
        """Leave the question about the spindle open if a record at rest after the last hit has a steady line.

        A weak one counts if the record before the first hit, baseline, has less of it. The response to the last hit may
        still decay, so the line must be as strong in the second half of the record.
        """
        line, middle = find_steady_line(record) or find_new_line(record, baseline), record.acceleration.size // 2
        if line is None or not line.is_asked:
            return
        halves = slice_record(record, 0, middle), slice_record(record, middle, record.acceleration.size)
        first, second = (measure_line(half, line.frequency) for half in halves)
        if second >= MIN_STEADY_RATIO * first:
            self.leave_open(SPINDLE_TURNING.code)

    def leave_open(self, code: str) -> None:
        """Leave a question open that is not accepted: the finished test asks it."""
        if code not in (*self.accepted, *self.left_open):
            self.left_open.append(code)

    def _show(self, reason: str, choice: Choice) -> None:
        """Show a question. An answer to the one before does not count."""
        if (self._publisher.state.word, self._publisher.state.reason) != (TapStep.ASK, reason):
            self._answers = queue.SimpleQueue[str]()
            self._publisher.show(word=TapStep.ASK, reason=reason, choices=(choice,))

    def _is_answered(self, choice: Choice) -> bool:
        while not self._answers.empty():
            if self._answers.get() == choice.key:
                self._publisher.show(choices=())
                return True
        return False
