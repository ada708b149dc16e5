"""Run the phases of a live test: self-check, trial hits and counted hits."""

import queue
import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from functools import partial

from acquisition import Block, DataError, Device, DeviceError, Hit, HitFlags, HitSearch, HitVerdict, Remark, Trigger
from acquisition.errors import join_sentences
from lobewatch.machine.daq_rates import check_device_rate, find_stored_rate, has_clock
from lobewatch.machine.folder import MachineFolder
from lobewatch.measurement.hit_remarks import find_hit_remarks
from lobewatch.measurement.recording_questions import RATE_NOT_VERIFIED
from lobewatch.tap.device_connection import (
    LEVEL_WINDOW,
    DeviceConnection,
    describe_device,
    estimate_resting_rms,
    label_device,
)
from lobewatch.tap.hit_check import add_steady_vibration, evaluate_safely
from lobewatch.tap.live_curves import build_curves
from lobewatch.tap.mass_check import check_mass_entry, store_emulator_check
from lobewatch.tap.rate_check import check_stream_rate, rate_remarks, refuse_wrong_rate
from lobewatch.tap.self_check import check_calibration, check_detectable_band, find_quiet_part, run_self_check
from lobewatch.tap.start_questions import StartQuestions
from lobewatch.tap.state import Check, StatePublisher, TapState, TapStep
from lobewatch.tap.tap_in_progress import TapInProgress
from lobewatch.tap.trial_hits import TrialHits, trigger_from_setup

MIN_VERDICT_TIME = 0.8
"""Time for which a verdict is shown at least (s). The trigger may be armed before."""
EARLY_HIT_TEXT = "The hit came while the tool still vibrated and does not count. Wait for TAP."
UNFELT_HIT_TEXT = (
    "The accelerometer shows a hit, but the force stays below the trigger level of {level:g} N. "
    "Hit harder, or check the hammer cable."
)
LAST_HIT_UNDO_TIME = 2.0
"""Time in which the last hit needed can be taken back (s)."""


class TapStopped(Exception):  # noqa: N818  (no error: the operator wished it)
    """Raised when the operator ends the test early. The hits stay stored, and the next test resumes with them."""


SELF_CHECK_DURATION = 1.0
"""Length of the record of the self-check (s)."""
REST_AFTER_DURATION = 2.0
"""Length of the record at rest after the last hit (s), chosen: it shows lines of 0.7 times the rms."""
MAX_RATE_TIME = 20.0
"""Length of the stream up to which it is read on after the last hit to verify its rate (s), chosen.

A buffer of 5 ms is then 0.025 % of it."""
RATE_STEP = 0.5
"""Time after which the rate is computed again (s)."""
RECONNECT_INTERVAL = 0.5
"""Time between two attempts to find the device again (s)."""


class TapPhases:
    """Phases of a live test: self-check, trial hits, counted hits. Each resumes where the device went away.

    Hits are captured, evaluated and shown, and requests are handled, between two blocks of the device.
    """

    def __init__(
        self,
        folder: MachineFolder,
        open_device: Callable[[], Device],
        publisher: StatePublisher[TapState],
        *,
        questions: StartQuestions,
        guided: bool,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Set up the phases.

        guided False omits the curves, the time to take back the last hit, re-arming by decay, and the self-check if no
        trial hits need it.
        """
        self._folder, self._open_device, self._publisher = folder, open_device, publisher
        self.questions, self._guided, self._sleep = questions, guided, sleep
        self.undos, self.stopping = threading.Semaphore(0), threading.Event()
        """Requests of any thread to take back the last good hit, each once, and to end the test."""
        self.decisions = queue.SimpleQueue[tuple[int | None, bool]]()
        """Requests of any thread to accept (True) or reject a hit, by its number; None is the last hit."""
        self._trial: TrialHits | None = None
        self._verdict, self._scan_count = TapStep.TAP, 0
        self._verdict_at: int | None = None
        self._is_one_stream = True
        self.remarks: tuple[Remark, ...] = ()
        """Remarks on the finished test: whether its sample rate is verified."""

    def run(self, tap: TapInProgress) -> None:
        """Run all phases, reconnecting as often as needed. DeviceError if the first connection fails."""
        self._tap = tap
        connection = self._connect()
        while True:
            try:
                with closing(connection.device):
                    self._check(connection)
                    self._try(connection)
                    while self._tap.missing:
                        self._take_hits(connection)
                        self._check_after(connection)
                return self._check_stream_rate(connection)
            except DeviceError as error:
                self._check_stream_rate(connection)
                if not self._tap.missing:
                    return None
                connection, self._is_one_stream = self._reconnect(error), False

    def _connect(self) -> DeviceConnection:
        """Open and start a device that fits the hits so far. Earlier button presses do not count.

        Raises DeviceError if there is none, ValueError if its set-up differs from that of earlier hits.
        """
        device, tap = self._open_device(), self._tap
        try:
            self._check_rate(device)
            connection = DeviceConnection(device, self._folder.machine.tap.quantity, tap.circumstances.direction)
            if device.identity.knows_sensors:
                store_emulator_check(self._folder, device.channels)
            tap.accept_device(device.sample_rate, connection.inputs.channels, describe_device(device))
            device.start()
            device.events.clear()
        except BaseException:
            device.close()
            raise
        self._publisher.show(device=label_device(device))
        return connection

    def _reconnect(self, error: DeviceError) -> DeviceConnection:
        """Wait for the device as long as needed."""
        while True:
            reason = join_sentences(error.text, "Plug the device in to continue with this hit")
            self._publisher.show(word=TapStep.NO_DEVICE, reason=reason, levels=None)
            self._sleep(RECONNECT_INTERVAL)
            self._handle_requests()
            try:
                connection = self._connect()
            except DeviceError as again:
                error = again
            else:
                self._publisher.show(word=TapStep.WAIT, reason="")
                return connection

    def _check_rate(self, device: Device) -> None:
        """Measure the sample rate of a device that this machine does not know yet."""
        if has_clock(device) and find_stored_rate(self._folder, device) is None:
            self._publisher.show(reason="The sample rate of the new device is being measured for 5 s.")
        remarks = list[Remark]()
        check_device_rate(self._folder, device, remarks=remarks)
        if remarks:
            self._publisher.show(checks=tuple(Check("sample rate", False, f"{remark}") for remark in remarks))

    def _check_stream_rate(self, connection: DeviceConnection) -> None:
        """Check the rate of the blocks so far, and show it. DataError if it is off the rate in use."""
        if (stream := connection.rate) is None:
            return
        is_whole = self._is_one_stream and not self._tap.n_resumed
        refuse_wrong_rate(self._tap, connection.device, stream, is_whole=is_whole)
        self.remarks = rate_remarks(stream)
        others = [check for check in self._publisher.state.checks if check.name != "sample rate"]
        self._publisher.show(checks=(*others, check_stream_rate(stream)))

    def _check_after(self, connection: DeviceConnection) -> None:
        """Read on until the sample rate is verified, and record the signals at rest again.

        A spindle that began to turn slowly during the test is seen only there.
        """
        blocks, stream = self._blocks(connection), connection.rate
        while stream is not None and stream.seconds < MAX_RATE_TIME and not stream.is_verified:
            if connection.read_on(blocks, RATE_STEP) is None:
                break
        if stream is not None and stream.seconds >= MAX_RATE_TIME and not stream.is_verified:
            self.questions.leave_open(RATE_NOT_VERIFIED.code)
        if self._tap.baseline is None or not self._guided or connection.device.identity.is_recording:
            return
        record = connection.read_on(blocks, REST_AFTER_DURATION)
        if record is not None:
            self.questions.check_after(find_quiet_part(record), self._tap.baseline)

    def _check(self, connection: DeviceConnection) -> None:
        """Run the self-check, once per session."""
        machine = self._folder.machine
        trigger = self._tap.trigger or trigger_from_setup(machine.tap, connection.device.sample_rate)
        if self._tap.baseline is not None or (trigger is not None and not self._guided):
            return
        baseline = self._record_rest(connection)
        self._tap.baseline, free = baseline, shutil.disk_usage(self._folder.path).free
        checks = [*self._publisher.state.checks]
        checks += _run_guarded_checks(baseline, trigger.level if trigger else None, free)
        checks.append(check_calibration(connection.inputs.channels, machine.daq.calibration_interval_months))
        checks += filter(None, [check_mass_entry(self._folder, connection)])
        if not baseline.has_force:
            checks.append(check_detectable_band(baseline, machine, self._tap.circumstances.tool))
        failed = [f"{check.name}: {check.text}" for check in checks if not check.passed]
        self._publisher.show(checks=tuple(checks), reason=join_sentences(*failed))

    def _record_rest(self, connection: DeviceConnection) -> Hit:
        """Record the signals at rest, after a person has confirmed that the spindle is stopped.

        Recordings, and emulated devices faster than real time, raise no question.
        """

        def record(duration: float = SELF_CHECK_DURATION) -> Hit:
            return find_quiet_part(connection.record(self._blocks(connection), duration))

        if connection.device.follows_clock:
            self.questions.confirm(partial(record, LEVEL_WINDOW))
        self._publisher.show(word=TapStep.CHECKING, reason="Keep the hammer away from the tool for a second.")
        return self.questions.settle(record(), record)

    def _try(self, connection: DeviceConnection) -> None:
        """Take trial hits if machine.toml leaves a trigger setting open."""
        tap, setup = self._tap, self._folder.machine.tap
        tap.trigger = tap.trigger or trigger_from_setup(setup, connection.device.sample_rate)
        if tap.trigger is not None or tap.baseline is None:
            return
        self._trial = trial = self._trial or TrialHits(setup, tap.baseline)
        asked = False
        while not trial.is_done:
            if not asked:
                self._publisher.show(reason=join_sentences(self._publisher.state.reason, trial.text))
            asked = self._take_trial_hit(connection, trial)
        tap.trigger = trial.trigger
        check = Check("trial hits", not trial.remarks, trial.text)
        self._publisher.show(checks=(*self._publisher.state.checks, check))

    def _take_trial_hit(self, connection: DeviceConnection, trial: TrialHits) -> bool:
        """Take a trial hit and return whether it was usable."""
        hit = next(filter(None, self._hits(connection, self._at_rest(trial.trigger))))
        verdict = add_steady_vibration(HitVerdict(HitFlags.OK), hit, self._tap.baseline)
        verdict = verdict if verdict.flags else evaluate_safely(lambda: HitVerdict(trial.add(hit)))
        self._show_verdict(verdict.flags, verdict.text or verdict.flags.cure or trial.text, trial=True)
        self._show_curves(hit)
        return not verdict.flags

    def _take_hits(self, connection: DeviceConnection) -> None:
        """Take hits until enough are good and the time to take back the last one has passed."""
        tap, undo_time = self._tap, LAST_HIT_UNDO_TIME if self._guided else 0.0
        if tap.trigger is None or any(hit.acceleration.size != tap.trigger.n_samples for hit in tap.hits):
            raise tap.make_setup_error()
        for hit in self._hits(connection, self._at_rest(tap.trigger)):
            if tap.missing and hit is not None:
                self._take(hit)
                found = connection.rate and connection.rate.find_deviation()
                if found and found.is_accurate:  # so that the kept hits get the right rate
                    self._check_stream_rate(connection)
            elif not tap.missing and self._verdict_age(connection.device.sample_rate) >= undo_time:
                return

    def _at_rest(self, trigger: Trigger) -> Trigger:
        """Return a trigger that is armed only at rest, if a person taps by hand."""
        if not self._guided or self._tap.baseline is None:
            return trigger
        return replace(trigger, rest_rms=estimate_resting_rms(self._tap.baseline, trigger.pre_trigger))

    def _blocks(self, connection: DeviceConnection) -> Iterator[Block]:
        """Yield the blocks of the device. Handle requests and show levels in between."""
        for block in connection.blocks():
            self._scan_count += block.codes.shape[1]
            for _ in range(connection.count_presses()):
                self._undo(" with the button")
            self._handle_requests()
            if fault_text := connection.poll_fault_text():
                self._publisher.show(reason=fault_text)
            yield block
            if self._publisher.age >= LEVEL_WINDOW:
                self._publisher.show(levels=connection.levels)
        if self._tap.missing:
            raise DataError(f"the samples ended after {self._tap.progress}. Record more hits.")

    def _handle_requests(self) -> None:
        """Do what other threads have requested. TapStopped if that ends the test."""
        while not self.decisions.empty():
            self._decide(*self.decisions.get())
        if self.stopping.is_set():
            raise TapStopped(
                f"stopped with {self._tap.good} good hits. Repeat the command to continue with these hits."
            )
        while self.undos.acquire(blocking=False):
            self._undo()

    def _hits(self, connection: DeviceConnection, trigger: Trigger) -> Iterator[Hit | None]:
        """Yield hits as they come, and None after every block. The shown step follows the trigger."""
        search = HitSearch(connection.device.channels, connection.device.sample_rate, trigger, connection.direction)
        n_early = 0
        for block in self._blocks(connection):
            was_armed, n_hits = search.armed, 0
            for n_hits, hit in enumerate(search.feed(block), 1):  # noqa: B007 - their number counts below
                yield hit
            yield None
            if was_armed and not n_hits and not search.recording and connection.is_hit_alone(self._tap.baseline):
                self._publisher.show(reason=UNFELT_HIT_TEXT.format(level=trigger.level))
            if search.too_early > n_early:
                n_early = search.too_early
                self._publisher.show(reason=EARLY_HIT_TEXT)
            self._show_trigger_step(search, connection.device.sample_rate)

    def _show_verdict(self, flags: HitFlags, reason: str, *, trial: bool = False) -> None:
        """Show the verdict on a hit."""
        self._verdict, self._verdict_at = TapStep.REFUSED if flags else TapStep.GOOD, self._scan_count
        self._publisher.show(word=self._verdict, verdict=flags.words, trial=trial, reason=reason)

    def _show_curves(self, hit: Hit) -> None:
        """Show the curves of a hit and of the mean, none if they cannot be computed."""
        if not self._guided:
            return
        try:
            plots = build_curves(hit, self._tap.mean)
        except Exception:  # noqa: BLE001 - as of the verdict: the test goes on without them
            plots = None
        self._publisher.show(plots=plots)

    def _show_hit_change(self) -> None:
        """Show how a mode changes over the good hits, nothing if that cannot be computed."""
        if not self._guided:
            return
        try:
            tap, band = self._tap, self._folder.machine.mode.band_hz
            change = next(find_hit_remarks(tap.hits, band, tap.decided_flags), None)
        except Exception:  # noqa: BLE001 - as of the verdict: the test goes on without it
            change = None
        self._publisher.show(hit_change=change)

    def _verdict_age(self, sample_rate: float) -> float:
        """Return how long the verdict has been shown (s), inf if none is."""
        return float("inf") if self._verdict_at is None else (self._scan_count - self._verdict_at) / sample_rate

    def _show_trigger_step(self, search: HitSearch, sample_rate: float) -> None:
        """Show the step that matches the trigger."""
        word = TapStep.TAP if search.armed else TapStep.WAIT
        is_fresh = self._verdict_age(sample_rate) < MIN_VERDICT_TIME or not self._tap.missing
        if self._verdict_at is not None and is_fresh and not search.recording:
            word = self._verdict
        if word != self._publisher.state.word:
            self._publisher.show(word=word)

    def _take(self, hit: Hit) -> None:
        """Evaluate a hit and show the verdict at once. It counts when it is on the disk."""
        verdict = self._tap.evaluate(hit)
        self._show_verdict(verdict.flags, verdict.text or " ".join(verdict.notes))
        self._tap.add(hit, verdict.flags, verdict.text)
        self._publisher.show(**self._tap.shown)
        self._show_curves(hit)
        if not verdict.flags and (outlier := self._tap.recheck_first_hits()) is not None:
            number, now = outlier
            self._show_taken_out(now.flags, f"Hit {number + 1} differs from the other hits and is excluded. {now.text}")
        else:
            self._show_hit_change()

    def _undo(self, means: str = "") -> None:
        if (number := self._tap.undo()) is not None:
            self._show_taken_out(HitFlags.UNDONE, f"Hit {number + 1} was undone{means}.")

    def _decide(self, number: int | None, accept: bool) -> None:
        """Accept or reject a hit, and show the decision once it is in the journal, or why it is impossible."""
        number = len(self._tap.hits) if number is None else number
        try:
            if not 1 <= number <= len(self._tap.hits):
                raise ValueError(f"hit {number} does not exist. Choose a hit of the list.")
            self._tap.decide(number - 1, accept=accept)
        except ValueError as error:
            self._publisher.show(reason=str(error))
            return
        if not accept:
            self._show_taken_out(HitFlags.UNDONE, f"Hit {number} was rejected by hand.")
            return
        self._verdict, self._verdict_at = TapStep.GOOD, self._scan_count
        faults = self._tap.flags[number - 1].words
        reason = f"Hit {number} was accepted by hand ({faults})."
        self._publisher.show(**self._tap.shown, word=self._verdict, verdict=faults, trial=False, reason=reason)
        self._show_curves(self._tap.hits[number - 1])

    def _show_taken_out(self, flags: HitFlags, reason: str) -> None:
        """Show that a good hit no longer counts. The word GOOD must disappear."""
        self._verdict_at = None
        word = self._publisher.state.word
        word = TapStep.WAIT if word in (TapStep.GOOD, TapStep.REFUSED) else word
        self._publisher.show(**self._tap.shown, word=word, verdict=flags.words, trial=False, reason=reason)
        self._show_curves(self._tap.hits[-1])
        self._show_hit_change()


def _run_guarded_checks(baseline: Hit, level: float | None, free_bytes: int) -> tuple[Check, ...]:
    """Run the self-check. If it fails, return one line that says so."""
    try:
        return run_self_check(baseline, level, free_bytes)
    except Exception as error:  # noqa: BLE001 - a check warns and ends no test
        text = f"failed ({type(error).__name__}: {error}). The test continues without this check."
        return (Check("self-check", False, text),)
