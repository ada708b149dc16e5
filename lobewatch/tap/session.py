"""A live tap test from the self-check to the result: one thread runs it, any thread may look and take a hit back."""

from __future__ import annotations

import shutil
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

from acquisition import (
    Block,
    Circumstances,
    DataError,
    DeviceError,
    Hit,
    HitFlags,
    HitSearch,
    RunningMean,
    TapTest,
    Trigger,
    Verdict,
    judge_hit,
)
from lobewatch.analysis import Logbook, Measurement
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.known_devices import checked_rate, has_clock, known_rate
from lobewatch.tap.in_progress import TapInProgress, begin_tap
from lobewatch.tap.live_signal import LEVEL_TIME, Device, LiveSignal, description, resting_rms
from lobewatch.tap.outcome import outcome_of
from lobewatch.tap.plots import plots_of
from lobewatch.tap.self_check import calibration_check, quiet_stretch, self_check
from lobewatch.tap.state import Check, TapState, Word
from lobewatch.tap.trial import Trial, trigger_of

BASELINE_TIME = 1.0
"""How long the self-check listens (s)."""
VERDICT_TIME = 0.8
"""How long a verdict is shown at least (s); the trigger may be armed before."""
UNDO_TIME = 2.0
"""Time in which the last hit needed can be taken back (s)."""
FEWEST_FOR_MEAN = 3
"""Hits in a mean that others are compared with."""
RETRY_TIME = 0.5
"""Pause between two tries to find the device again (s)."""


class TapStopped(Exception):  # noqa: N818  (no error: the operator wished it)
    """The operator ended the test before enough hits were good; they stay in the spool, the next test goes on."""


class TapSession:
    """One tap test of one machine: `run` it in one thread; `state`, `undo` and `stop` are for every thread."""

    def __init__(
        self,
        folder: MachineFolder,
        open_device: Callable[[], Device],
        circumstances: Circumstances,
        *,
        resume: bool = True,
        guided: bool = True,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Nothing is opened yet. guided False leaves out what only a person needs: self-check, re-arming by decay,
        curves, the time to take back the last hit, and the outcome."""
        self._folder, self._open_device, self._about = folder, open_device, circumstances
        self._resume, self._guided, self._clock, self._sleep = resume, guided, clock, sleep
        about = f"{circumstances.machine}, tool {circumstances.tool}, direction {circumstances.direction}"
        self._state = TapState(0, Word.CHECKING, about, wanted=folder.machine.tap.hits)
        self._undos, self._stopping = threading.Semaphore(0), threading.Event()
        self._mean = RunningMean()
        self._baseline: Hit | None = None
        self._fault = ""
        self._trial: Trial | None = None
        self._verdict = Word.TAP
        self._heard, self._verdict_at, self._shown_at = 0, 0, clock()
        self._measurement: Measurement | None = None

    @property
    def state(self) -> TapState:
        """The newest picture of the test; never changed, only replaced."""
        return self._state

    @property
    def measurement(self) -> Measurement:
        """What the finished test says of the spindle; ValueError before the end."""
        if self._measurement is None:
            raise ValueError("the tap test is not finished; there is no measurement before run() has returned")
        return self._measurement

    def undo(self) -> None:
        """Take back the last good hit; again: the one before."""
        self._undos.release()

    def stop(self) -> None:
        """End the test now; `run` raises TapStopped, the hits so far stay in the spool."""
        self._stopping.set()

    def run(self) -> TapTest:
        """Take hits until enough are good, commit the test and return it; blocks.

        Raises DeviceError where there is no device at the start (later it is waited for), DataError where another
        program writes to the folder or the disk is full, ValueError where the interrupted test was recorded with
        another set-up, TapStopped after stop().
        """
        try:
            with self._folder.locked():
                self._begin()
                if self._missing:
                    self._take_hits()
                return self._finish()
        except (DeviceError, ValueError) as error:
            self._show(word=Word.FAILED, reason=str(error))
            raise
        except TapStopped:
            raise
        except Exception as error:
            told = _told(error)
            self._show(word=Word.FAILED, reason=str(told))
            raise told from error

    @property
    def _missing(self) -> int:
        """How many good hits are still to come."""
        return max(self._state.wanted - self._tap.good, 0)

    def _begin(self) -> None:
        self._tap: TapInProgress = begin_tap(self._folder, self._about, self._resume)
        for hit, flags in zip(self._tap.hits, self._tap.flags, strict=True):
            if not flags:
                self._mean.add(hit)
        if self._tap.hits:
            begun = f"{self._tap.circumstances.created:%Y-%m-%d %H:%M} UTC"
            there = f"{self._tap.good} of {self._state.wanted} good hits are there"
            self._show_hits(resumed=f"going on with the test begun {begun}: {there}")

    def _take_hits(self) -> None:
        """All phases; each goes on where it stood when the device went away."""
        self._connect()
        try:
            while True:
                try:
                    self._check()
                    self._try()
                    self._tap_on()
                    return
                except DeviceError as error:
                    if not self._missing:
                        return
                    self._reconnect(error)
        finally:
            self._device.close()

    def _connect(self) -> None:
        self._device = self._open_device()
        try:
            self._measure_rate()
            self._signal = LiveSignal(self._device)
            known = self._tap.hits[-1] if self._tap.hits else self._baseline
            now = self._device.sample_rate, self._signal.channels
            if known is not None and (known.sample_rate, known.channels) != now:
                raise self._other_setup()
            self._device.start()
        except BaseException:
            self._device.close()
            raise
        if not self._tap.hits:
            self._tap.circumstances = replace(self._tap.circumstances, device=description(self._device))
        self._show(device=f"{self._device.info['model']}, {self._device.sample_rate:g} Hz")

    def _measure_rate(self) -> None:
        """Against the clock, of a device that this machine does not know yet."""
        if has_clock(self._device) and known_rate(self._folder, self._device) is None:
            self._show(reason="New device: its sample rate is measured against the clock for 5 s.")
        checked_rate(self._folder, self._device)

    def _other_setup(self) -> ValueError:
        return ValueError(
            f"the interrupted test {self._tap.id} was recorded with another length, sample rate or sensor; "
            "begin anew with --new"
        )

    def _reconnect(self, error: DeviceError) -> None:
        """Wait for the device, as long as it takes."""
        self._device.close()
        while True:
            reason = f"{str(error).partition(';')[0]}; plug it in: the test goes on at this hit"
            self._show(word=Word.NO_DEVICE, reason=reason, levels=None)
            self._sleep(RETRY_TIME)
            self._serve()
            try:
                self._connect()
            except DeviceError as again:
                error = again
            else:
                self._show(word=Word.WAIT, reason="")
                return

    def _blocks(self) -> Iterator[Block]:
        """What the device sends; requests are served and levels shown in between."""
        for block in self._device.blocks():
            self._heard += block.codes.shape[1]
            self._signal.add(block)
            self._serve()
            self._tell_fault()
            yield block
            if self._clock() - self._shown_at >= LEVEL_TIME:
                self._show(levels=self._signal.levels)
        if self._missing:
            good = f"{self._tap.good} of {self._state.wanted} good hits"
            raise DataError(f"the samples have ended with {good}; record more of them")

    def _tell_fault(self) -> None:
        """A pulled sensor cable or a sensor without supply, where the device reports that, and that it is mended."""
        fault = getattr(self._device, "fault", "")
        if fault != self._fault:
            self._fault = fault
            self._show(reason=fault or "The sensor is connected again.")

    def _serve(self) -> None:
        """What other threads have asked for."""
        if self._stopping.is_set():
            raise TapStopped(f"stopped with {self._tap.good} good hits; the same command goes on with them")
        while self._undos.acquire(blocking=False):
            number = self._tap.undo()
            if number is not None:
                self._show_taken_out(number, "undone", f"Hit {number + 1} was taken back.")

    def _check(self) -> None:
        """The self-check, once a session."""
        trigger = self._tap.trigger or trigger_of(self._folder.machine.tap, self._device.sample_rate)
        if self._baseline is not None or (trigger is not None and not self._guided):
            return
        self._show(word=Word.CHECKING, reason="Keep the hammer away for a second.")
        self._baseline = quiet_stretch(self._signal.record(self._blocks(), BASELINE_TIME))
        free = shutil.disk_usage(self._folder.path).free
        calibration = calibration_check(self._signal.channels, self._folder.machine.daq.calibration_interval_months)
        checks = (*self_check(self._baseline, trigger.level if trigger else None, free), calibration)
        failed = [f"{check.name}: {check.text}." for check in checks if not check.passed]
        self._show(checks=checks, reason=" ".join(failed))

    def _try(self) -> None:
        """Trial hits, where machine.toml leaves something open."""
        if self._tap.trigger is None:
            self._tap.trigger = trigger_of(self._folder.machine.tap, self._device.sample_rate)
        if self._tap.trigger is not None or self._baseline is None:
            return
        self._trial = self._trial or Trial(self._folder.machine.tap, self._baseline)
        while not self._trial.done:
            if self._trial.text not in self._state.reason:
                self._show(reason=f"{self._state.reason} {self._trial.text}".strip())
            hit = next(hit for hit in self._hits(self._trial.trigger) if hit is not None)
            refused = self._trial.add(hit)
            words = f"{refused.words}, trial hit" if refused else "trial hit"
            self._show_verdict(refused, words, refused.cure or self._trial.text)
            self._draw(hit)
        self._tap.trigger = self._trial.trigger
        found = Check("trial hits", not self._trial.remarks, self._trial.text.removesuffix("."))
        self._show(checks=(*self._state.checks, found))

    def _tap_on(self) -> None:
        """Hits until enough are good, and time has passed to take the last one back."""
        trigger = self._tap.trigger
        if trigger is None or any(hit.force.size != trigger.n_samples for hit in self._tap.hits):
            raise self._other_setup()
        grace = UNDO_TIME * self._device.sample_rate if self._guided else 0.0
        for hit in self._hits(trigger):
            if self._missing and hit is not None:
                self._take(hit)
            elif not self._missing and self._heard - self._verdict_at >= grace:
                return

    def _hits(self, trigger: Trigger) -> Iterator[Hit | None]:
        """Hits as they come, and None after every block; the word follows the trigger."""
        if self._guided and self._baseline is not None:
            trigger = replace(trigger, rest_rms=resting_rms(self._baseline, trigger.pre_trigger))
        search = HitSearch(self._device.channels, self._device.sample_rate, trigger)
        early = 0
        for block in self._blocks():
            yield from search.feed(block)
            yield None
            if search.too_early > early:
                early = search.too_early
                self._show(reason="That hit came while the tool still moved and does not count: wait for TAP.")
            self._follow(search)

    def _follow(self, search: HitSearch) -> None:
        """The word for where the trigger stands."""
        fresh = self._heard - self._verdict_at < VERDICT_TIME * self._device.sample_rate or not self._missing
        word = Word.TAP if search.armed else Word.WAIT
        if self._verdict_at and fresh and not search.recording:
            word = self._verdict
        if word != self._state.word:
            self._show(word=word)

    def _take(self, hit: Hit) -> None:
        """Judge a hit and show the verdict at once; it is counted when it is on the disk."""
        verdict = self._judge(hit)
        self._show_verdict(verdict.flags, verdict.flags.words, verdict.text)
        self._tap.add(hit, verdict.flags, verdict.text)
        if not verdict.flags:
            self._mean.add(hit)
        self._show_hits()
        self._draw(hit)
        if not verdict.flags:
            self._look_back()

    def _look_back(self) -> None:
        """Judge the first hits, which had no mean to be compared with, against the mean of all others."""
        if not FEWEST_FOR_MEAN < len(self._mean.hits) <= 2 * FEWEST_FOR_MEAN:
            return
        for hit in self._mean.hits[:FEWEST_FOR_MEAN]:
            verdict = judge_hit(hit, self._mean.without(hit))
            if verdict.flags:
                number = next(i for i, other in enumerate(self._tap.hits) if other is hit)
                self._tap.take_out(number, verdict.flags, verdict.text)
                reason = f"Hit {number + 1} does not fit the others and counts no more. {verdict.text}"
                self._show_taken_out(number, verdict.flags.words, reason)
                return

    def _judge(self, hit: Hit) -> Verdict:
        """Against the mean, too, where that has enough hits to tell how far they scatter."""
        mean = self._mean.frf if len(self._mean.hits) >= FEWEST_FOR_MEAN else None
        return judge_hit(hit, mean, self._folder.machine.mode.band_hz)

    def _show_verdict(self, flags: HitFlags, verdict: str, reason: str) -> None:
        self._verdict, self._verdict_at = Word.REFUSED if flags else Word.GOOD, self._heard
        self._show(word=self._verdict, verdict=verdict, reason=reason)

    def _show_taken_out(self, number: int, verdict: str, reason: str) -> None:
        """A hit that was good counts no more: the word GOOD must not stand there any longer."""
        self._mean.remove(self._tap.hits[number])
        self._verdict_at = 0
        word = Word.WAIT if self._state.word in (Word.GOOD, Word.REFUSED) else self._state.word
        self._show_hits(word=word, verdict=verdict, reason=reason)
        self._draw(self._tap.hits[-1])

    def _show_hits(self, **changes: Any) -> None:
        """The list of hits and what follows from it."""
        tap, mean = self._tap, self._mean
        self._show(hits=tap.taken, good=tap.good, mean_change=mean.change, settled=mean.settled, **changes)

    def _draw(self, hit: Hit) -> None:
        if self._guided:
            self._show(plots=plots_of(hit, self._mean))

    def _show(self, **changes: Any) -> None:
        self._state = replace(self._state, revision=self._state.revision + 1, **changes)
        self._shown_at = self._clock()

    def _finish(self) -> TapTest:
        """Average, commit, and say what it means."""
        self._show(word=Word.DONE, reason="The result is being worked out.", levels=None)
        tap = self._tap.finish()
        logbook = Logbook(self._folder)
        logbook.commit(tap)
        self._measurement = logbook.measurement(tap.id)
        outcome = outcome_of(logbook, self._measurement) if self._guided else None
        self._show(reason="", outcome=outcome)
        return tap


def _told(error: Exception) -> Exception:
    """A failure of the system (a full disk) or of the program in a sentence that the operator can act on."""
    kept = "the hits so far are kept: the same command goes on with them"
    if isinstance(error, OSError):
        return DataError(f"{error.filename}: {error.strerror or error}; make room or put the disk right, {kept}")
    return RuntimeError(f"lobewatch itself has failed ({type(error).__name__}: {error}); {kept}")
