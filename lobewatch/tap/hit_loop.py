"""From the scans of a device to judged hits, and the word that stands meanwhile."""

from __future__ import annotations

import threading
from collections.abc import Iterator

from acquisition import Block, DataError, Hit, HitFlags, HitSearch, Trigger
from lobewatch.tap.connection import Connection
from lobewatch.tap.judged_hits import JudgedHits
from lobewatch.tap.live_signal import LEVEL_TIME
from lobewatch.tap.plots import plots_of
from lobewatch.tap.publisher import Publisher
from lobewatch.tap.state import TapStep

VERDICT_TIME = 0.8
"""Time for which a verdict is shown at least (s); the trigger may be armed before."""
UNDO_TIME = 2.0
"""Time in which the last hit needed can be taken back (s)."""


class TapStopped(Exception):  # noqa: N818  (no error: the operator wished it)
    """The operator ended the test before enough hits were good; they stay in the spool, the next test goes on."""


class Wishes:
    """Undo and stop, said by any thread and heard by that of the test."""

    def __init__(self) -> None:
        """Nothing is asked for."""
        self._undos, self._stopping = threading.Semaphore(0), threading.Event()

    def undo(self) -> None:
        """Take back the last good hit; again: the one before."""
        self._undos.release()

    def stop(self) -> None:
        """End the test."""
        self._stopping.set()

    @property
    def stopping(self) -> bool:
        """Whether the test is to end."""
        return self._stopping.is_set()

    def take_undo(self) -> bool:
        """Whether one more hit is to be taken back; each wish is told once."""
        return self._undos.acquire(blocking=False)


class HitLoop:
    """Finds hits, judges and shows them, and serves what is asked for between two blocks."""

    def __init__(self, hits: JudgedHits, publisher: Publisher, wishes: Wishes, *, guided: bool) -> None:
        """guided False leaves out the curves and the time to take back the last hit."""
        self._hits, self._publisher, self._wishes, self._guided = hits, publisher, wishes, guided
        self._verdict = TapStep.TAP
        self._heard = 0
        self._verdict_at: int | None = None

    def blocks(self, connection: Connection) -> Iterator[Block]:
        """Blocks that the device sends; wishes are served and levels shown in between."""
        for block in connection.blocks():
            self._heard += block.codes.shape[1]
            for _ in range(connection.presses()):
                self._undo(" by the button")
            self.serve()
            if news := connection.news():
                self._publisher.show(reason=news)
            yield block
            if self._publisher.age >= LEVEL_TIME:
                self._publisher.show(levels=connection.signal.levels)
        if self._hits.missing:
            raise DataError(f"the samples have ended with {self._hits.progress}; record more of them")

    def serve(self) -> None:
        """Do what other threads have asked for; TapStopped where that is the end."""
        if self._wishes.stopping:
            raise TapStopped(f"stopped with {self._hits.tap.good} good hits; the same command goes on with them")
        while self._wishes.take_undo():
            self._undo()

    def hits(self, connection: Connection, trigger: Trigger) -> Iterator[Hit | None]:
        """Hits as they come, and None after every block; the word follows the trigger."""
        search = HitSearch(connection.channels, connection.sample_rate, trigger, connection.direction)
        early = 0
        for block in self.blocks(connection):
            yield from search.feed(block)
            yield None
            if search.too_early > early:
                early = search.too_early
                self._publisher.show(
                    reason="That hit came while the tool still moved and does not count: wait for TAP."
                )
            self._follow(search, connection.sample_rate)

    def take_hits(self, connection: Connection, trigger: Trigger) -> None:
        """Hits until enough are good, and time has passed to take the last one back."""
        grace = UNDO_TIME if self._guided else 0.0
        for hit in self.hits(connection, trigger):
            if self._hits.missing and hit is not None:
                self._take(hit)
            elif not self._hits.missing and self._verdict_age(connection.sample_rate) >= grace:
                return

    def show_verdict(self, flags: HitFlags, reason: str, *, trial: bool = False) -> None:
        """Say at once what became of a hit."""
        self._verdict, self._verdict_at = TapStep.REFUSED if flags else TapStep.GOOD, self._heard
        self._publisher.show(word=self._verdict, verdict=flags.words, trial=trial, reason=reason)

    def draw(self, hit: Hit) -> None:
        """The curves of a hit and of the mean; none where they cannot be worked out."""
        if not self._guided:
            return
        try:
            plots = plots_of(hit, self._hits.mean)
        except Exception:  # noqa: BLE001 - as of the verdict: the test goes on without them
            plots = None
        self._publisher.show(plots=plots)

    def _verdict_age(self, sample_rate: float) -> float:
        """Time for which the verdict has been shown (s); inf where none is."""
        return float("inf") if self._verdict_at is None else (self._heard - self._verdict_at) / sample_rate

    def _follow(self, search: HitSearch, sample_rate: float) -> None:
        """The word for where the trigger stands."""
        word = TapStep.TAP if search.armed else TapStep.WAIT
        fresh = self._verdict_age(sample_rate) < VERDICT_TIME or not self._hits.missing
        if self._verdict_at is not None and fresh and not search.recording:
            word = self._verdict
        if word != self._publisher.state.word:
            self._publisher.show(word=word)

    def _take(self, hit: Hit) -> None:
        """Judge a hit and show the verdict at once; it is counted when it is on the disk."""
        verdict = self._hits.judge(hit)
        self.show_verdict(verdict.flags, verdict.text)
        self._hits.add(hit, verdict)
        self._publisher.show_hits(self._hits)
        self.draw(hit)
        misfit = None if verdict.flags else self._hits.look_back()
        if misfit is not None:
            number, why = misfit
            reason = f"Hit {number + 1} does not fit the others and counts no more. {why.text}"
            self._show_taken_out(why.flags, reason)

    def _undo(self, means: str = "") -> None:
        number = self._hits.undo()
        if number is not None:
            self._show_taken_out(HitFlags.UNDONE, f"Hit {number + 1} was taken back{means}.")

    def _show_taken_out(self, flags: HitFlags, reason: str) -> None:
        """A hit that was good counts no more: the word GOOD must not stand there any longer."""
        self._verdict_at = None
        word = self._publisher.state.word
        word = TapStep.WAIT if word in (TapStep.GOOD, TapStep.REFUSED) else word
        self._publisher.show_hits(self._hits, word=word, verdict=flags.words, trial=False, reason=reason)
        self.draw(self._hits.tap.hits[-1])
