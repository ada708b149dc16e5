"""Run the phases of a live test: self-check, trial hits and counted hits."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace

from acquisition import Block, DataError, DeviceError, Hit, HitFlags, HitSearch, HitVerdict, Trigger
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.device_connection import LEVEL_WINDOW, DeviceConnection, DeviceConnector, estimate_resting_rms
from lobewatch.tap.evaluated_hits import EvaluatedHits, TapPublisher
from lobewatch.tap.live_curves import build_curves
from lobewatch.tap.self_check import check_calibration, check_detectable_band, find_quiet_part, run_self_check
from lobewatch.tap.state import Check, TapStep
from lobewatch.tap.tap_in_progress import evaluate_safely
from lobewatch.tap.trial_hits import TrialHits, trigger_from_setup

MIN_VERDICT_TIME = 0.8
"""Time for which a verdict is shown at least (s). The trigger may be armed before."""
LAST_HIT_UNDO_TIME = 2.0
"""Time in which the last hit needed can be taken back (s)."""


class TapStopped(Exception):  # noqa: N818  (no error: the operator wished it)
    """Raised when the operator ends the test early. The hits stay stored, and the next test resumes with them."""


class OperatorRequests:
    """Requests to undo or stop, made by any thread and handled by that of the test."""

    def __init__(self) -> None:
        self._undos, self._stopping = threading.Semaphore(0), threading.Event()

    def undo(self) -> None:
        """Request to take back the last good hit. Again: the one before."""
        self._undos.release()

    def stop(self) -> None:
        self._stopping.set()

    @property
    def stopping(self) -> bool:
        """True if the test is to end."""
        return self._stopping.is_set()

    def take_undo(self) -> bool:
        """Return whether one more hit is to be taken back. Each request counts once."""
        return self._undos.acquire(blocking=False)


class HitLoop:
    """Loop that captures, evaluates and shows hits, and handles requests between two blocks."""

    def __init__(
        self, hits: EvaluatedHits, publisher: TapPublisher, requests: OperatorRequests, *, guided: bool
    ) -> None:
        """Set up the loop. guided False omits the curves and the time to take back the last hit."""
        self._hits, self._publisher, self._requests, self._guided = hits, publisher, requests, guided
        self._verdict = TapStep.TAP
        self._scan_count = 0
        self._verdict_at: int | None = None

    def blocks(self, connection: DeviceConnection) -> Iterator[Block]:
        """Yield the blocks of the device. Handle requests and show levels in between."""
        for block in connection.blocks():
            self._scan_count += block.codes.shape[1]
            for _ in range(connection.count_presses()):
                self._undo(" by the button")
            self.handle_requests()
            if fault_text := connection.poll_fault_text():
                self._publisher.show(reason=fault_text)
            yield block
            if self._publisher.age >= LEVEL_WINDOW:
                self._publisher.show(levels=connection.signal.levels)
        if self._hits.missing:
            raise DataError(f"the samples have ended with {self._hits.progress}; record more of them")

    def handle_requests(self) -> None:
        """Do what other threads have requested. TapStopped if that ends the test."""
        if self._requests.stopping:
            raise TapStopped(f"stopped with {self._hits.tap.good} good hits; the same command goes on with them")
        while self._requests.take_undo():
            self._undo()

    def hits(self, connection: DeviceConnection, trigger: Trigger) -> Iterator[Hit | None]:
        """Yield hits as they come, and None after every block. The shown step follows the trigger."""
        search = HitSearch(connection.channels, connection.sample_rate, trigger, connection.direction)
        n_early = 0
        for block in self.blocks(connection):
            yield from search.feed(block)
            yield None
            if search.too_early > n_early:
                n_early = search.too_early
                self._publisher.show(
                    reason="That hit came while the tool still moved and does not count: wait for TAP."
                )
            self._show_trigger_step(search, connection.sample_rate)

    def take_hits(self, connection: DeviceConnection, trigger: Trigger) -> None:
        """Take hits until enough are good and the time to take back the last one has passed."""
        undo_time = LAST_HIT_UNDO_TIME if self._guided else 0.0
        for hit in self.hits(connection, trigger):
            if self._hits.missing and hit is not None:
                self._take(hit)
            elif not self._hits.missing and self._verdict_age(connection.sample_rate) >= undo_time:
                return

    def show_verdict(self, flags: HitFlags, reason: str, *, trial: bool = False) -> None:
        """Show the verdict on a hit."""
        self._verdict, self._verdict_at = TapStep.REFUSED if flags else TapStep.GOOD, self._scan_count
        self._publisher.show(word=self._verdict, verdict=flags.words, trial=trial, reason=reason)

    def show_curves(self, hit: Hit) -> None:
        """Show the curves of a hit and of the mean, none if they cannot be computed."""
        if not self._guided:
            return
        try:
            plots = build_curves(hit, self._hits.mean)
        except Exception:  # noqa: BLE001 - as of the verdict: the test goes on without them
            plots = None
        self._publisher.show(plots=plots)

    def _verdict_age(self, sample_rate: float) -> float:
        """Return how long the verdict has been shown (s), inf if none is."""
        return float("inf") if self._verdict_at is None else (self._scan_count - self._verdict_at) / sample_rate

    def _show_trigger_step(self, search: HitSearch, sample_rate: float) -> None:
        """Show the step that matches the trigger."""
        word = TapStep.TAP if search.armed else TapStep.WAIT
        is_fresh = self._verdict_age(sample_rate) < MIN_VERDICT_TIME or not self._hits.missing
        if self._verdict_at is not None and is_fresh and not search.recording:
            word = self._verdict
        if word != self._publisher.state.word:
            self._publisher.show(word=word)

    def _take(self, hit: Hit) -> None:
        """Evaluate a hit and show the verdict at once. It counts when it is on the disk."""
        verdict = self._hits.evaluate(hit)
        self.show_verdict(verdict.flags, verdict.text)
        self._hits.add(hit, verdict)
        self._publisher.show_hits(self._hits)
        self.show_curves(hit)
        outlier = None if verdict.flags else self._hits.recheck_first_hits()
        if outlier is not None:
            number, verdict_now = outlier
            reason = f"Hit {number + 1} does not fit the others and counts no more. {verdict_now.text}"
            self._show_taken_out(verdict_now.flags, reason)

    def _undo(self, means: str = "") -> None:
        number = self._hits.undo()
        if number is not None:
            self._show_taken_out(HitFlags.UNDONE, f"Hit {number + 1} was taken back{means}.")

    def _show_taken_out(self, flags: HitFlags, reason: str) -> None:
        """Show that a good hit no longer counts. The word GOOD must disappear."""
        self._verdict_at = None
        word = self._publisher.state.word
        word = TapStep.WAIT if word in (TapStep.GOOD, TapStep.REFUSED) else word
        self._publisher.show_hits(self._hits, word=word, verdict=flags.words, trial=False, reason=reason)
        self.show_curves(self._hits.tap.hits[-1])


SELF_CHECK_DURATION = 1.0
"""Length of the record of the self-check (s)."""


class TapPhases:
    """Phases of a live test: self-check, trial hits, counted hits. Each resumes where the device went away."""

    def __init__(
        self, folder: MachineFolder, hits: EvaluatedHits, loop: HitLoop, publisher: TapPublisher, *, guided: bool
    ) -> None:
        """Set up the phases. guided False omits re-arming by decay, and the self-check if no trial hits need it."""
        self._folder, self._hits, self._loop, self._publisher = folder, hits, loop, publisher
        self._tap, self._guided = hits.tap, guided
        self._trial: TrialHits | None = None

    def run(self, connector: DeviceConnector) -> None:
        """Run all phases, reconnecting as often as needed. DeviceError if the first connection fails."""
        connection = connector.connect(self._tap)
        while True:
            try:
                with closing(connection):
                    self._check(connection)
                    self._try(connection)
                    self._take(connection)
                return
            except DeviceError as error:
                if not self._hits.missing:
                    return
                connection = connector.reconnect(error, self._tap, self._loop.handle_requests)

    def _check(self, connection: DeviceConnection) -> None:
        """Run the self-check, once per session."""
        machine = self._folder.machine
        trigger = self._tap.trigger or trigger_from_setup(machine.tap, connection.sample_rate)
        if self._tap.baseline is not None or (trigger is not None and not self._guided):
            return
        self._publisher.show(word=TapStep.CHECKING, reason="Keep the hammer away for a second.")
        self._tap.baseline = find_quiet_part(
            connection.signal.record(self._loop.blocks(connection), SELF_CHECK_DURATION)
        )
        free = shutil.disk_usage(self._folder.path).free
        calibration = check_calibration(connection.signal.inputs.channels, machine.daq.calibration_interval_months)
        checks = (
            *self._publisher.state.checks,
            *_run_guarded_checks(self._tap.baseline, trigger.level if trigger else None, free),
            calibration,
            *self._hearing(self._tap.baseline),
        )
        failed = [f"{check.name}: {check.text}." for check in checks if not check.passed]
        self._publisher.show(checks=checks, reason=" ".join(failed))

    def _hearing(self, baseline: Hit) -> tuple[Check, ...]:
        """Check the detectable band if there is no force sensor."""
        if baseline.has_force:
            return ()
        return (check_detectable_band(baseline, self._folder.machine, self._tap.circumstances.tool),)

    def _try(self, connection: DeviceConnection) -> None:
        """Take trial hits if machine.toml leaves a trigger setting open."""
        tap, setup = self._tap, self._folder.machine.tap
        tap.trigger = tap.trigger or trigger_from_setup(setup, connection.sample_rate)
        if tap.trigger is not None or tap.baseline is None:
            return
        self._trial = self._trial or TrialHits(setup, tap.baseline)
        self._take_trial_hits(connection, self._trial)
        tap.trigger = self._trial.trigger
        check = Check("trial hits", not self._trial.remarks, self._trial.text.removesuffix("."))
        self._publisher.show(checks=(*self._publisher.state.checks, check))

    def _take_trial_hits(self, connection: DeviceConnection, trial: TrialHits) -> None:
        asked = False
        while not trial.is_done:
            if not asked:
                self._publisher.show(reason=f"{self._publisher.state.reason} {trial.text}".strip())
            asked = self._take_trial_hit(connection, trial)

    def _take_trial_hit(self, connection: DeviceConnection, trial: TrialHits) -> bool:
        """Take a trial hit and return whether it was usable."""
        hits = self._loop.hits(connection, self._at_rest(trial.trigger))
        hit = next(hit for hit in hits if hit is not None)
        verdict = evaluate_safely(lambda: HitVerdict(trial.add(hit)))
        flags = verdict.flags
        self._loop.show_verdict(flags, verdict.text or flags.cure or trial.text, trial=True)
        self._loop.show_curves(hit)
        return not flags

    def _take(self, connection: DeviceConnection) -> None:
        trigger = self._tap.trigger
        if trigger is None or any(hit.acceleration.size != trigger.n_samples for hit in self._tap.hits):
            raise self._tap.make_setup_error()
        self._loop.take_hits(connection, self._at_rest(trigger))

    def _at_rest(self, trigger: Trigger) -> Trigger:
        """Return a trigger that is armed only at rest, if a person taps by hand."""
        if not self._guided or self._tap.baseline is None:
            return trigger
        return replace(trigger, rest_rms=estimate_resting_rms(self._tap.baseline, trigger.pre_trigger))


def _run_guarded_checks(baseline: Hit, level: float | None, free_bytes: int) -> tuple[Check, ...]:
    """Run the self-check. If it fails, return one line that says so."""
    try:
        return run_self_check(baseline, level, free_bytes)
    except Exception as error:  # noqa: BLE001 - a check warns and ends no test
        return (
            Check("self-check", False, f"it failed ({type(error).__name__}: {error}); the test goes on without it"),
        )
