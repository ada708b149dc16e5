"""The phases of a live test in which the device is listened to."""

from __future__ import annotations

import shutil
from contextlib import closing
from dataclasses import replace

from acquisition import DeviceError, Hit, HitVerdict, Trigger
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.connection import Connection, Connector
from lobewatch.tap.guarded_verdict import guarded_verdict
from lobewatch.tap.hearing import hearing_check
from lobewatch.tap.hit_loop import HitLoop
from lobewatch.tap.judged_hits import JudgedHits
from lobewatch.tap.live_signal import resting_rms
from lobewatch.tap.publisher import Publisher
from lobewatch.tap.self_check import calibration_check, quiet_stretch, self_check
from lobewatch.tap.state import Check, TapStep
from lobewatch.tap.trial import Trial, trigger_of

BASELINE_TIME = 1.0
"""Time for which the self-check listens (s)."""


class Phases:
    """Self-check, trial hits, hits that count; each goes on where it stood when the device went away."""

    def __init__(
        self, folder: MachineFolder, hits: JudgedHits, loop: HitLoop, publisher: Publisher, *, guided: bool
    ) -> None:
        """guided False leaves out the self-check where no trial hits need it, and re-arming by decay."""
        self._folder, self._hits, self._loop, self._publisher = folder, hits, loop, publisher
        self._tap, self._guided = hits.tap, guided
        self._trial: Trial | None = None

    def run(self, connector: Connector) -> None:
        """All of them, with as many connections as it takes; DeviceError where the first one cannot be made."""
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
                connection = connector.reconnect(error, self._tap, self._loop.serve)

    def _check(self, connection: Connection) -> None:
        """The self-check, once a session."""
        machine = self._folder.machine
        trigger = self._tap.trigger or trigger_of(machine.tap, connection.sample_rate)
        if self._tap.baseline is not None or (trigger is not None and not self._guided):
            return
        self._publisher.show(word=TapStep.CHECKING, reason="Keep the hammer away for a second.")
        self._tap.baseline = quiet_stretch(connection.signal.record(self._loop.blocks(connection), BASELINE_TIME))
        free = shutil.disk_usage(self._folder.path).free
        calibration = calibration_check(connection.signal.inputs.channels, machine.daq.calibration_interval_months)
        checks = (
            *self._publisher.state.checks,
            *_guarded_checks(self._tap.baseline, trigger.level if trigger else None, free),
            calibration,
            *self._hearing(self._tap.baseline),
        )
        failed = [f"{check.name}: {check.text}." for check in checks if not check.passed]
        self._publisher.show(checks=checks, reason=" ".join(failed))

    def _hearing(self, baseline: Hit) -> tuple[Check, ...]:
        """What the sensor can hear, where it is all there is."""
        if baseline.has_force:
            return ()
        return (hearing_check(baseline, self._folder.machine, self._tap.circumstances.tool),)

    def _try(self, connection: Connection) -> None:
        """Trial hits, where machine.toml leaves something open."""
        tap, setup = self._tap, self._folder.machine.tap
        tap.trigger = tap.trigger or trigger_of(setup, connection.sample_rate)
        if tap.trigger is not None or tap.baseline is None:
            return
        self._trial = self._trial or Trial(setup, tap.baseline)
        self._take_trial_hits(connection, self._trial)
        tap.trigger = self._trial.trigger
        check = Check("trial hits", not self._trial.remarks, self._trial.text.removesuffix("."))
        self._publisher.show(checks=(*self._publisher.state.checks, check))

    def _take_trial_hits(self, connection: Connection, trial: Trial) -> None:
        asked = False
        while not trial.done:
            if not asked:
                self._publisher.show(reason=f"{self._publisher.state.reason} {trial.text}".strip())
            asked = self._take_trial_hit(connection, trial)

    def _take_trial_hit(self, connection: Connection, trial: Trial) -> bool:
        """Whether the next hit is of use."""
        hits = self._loop.hits(connection, self._at_rest(trial.trigger))
        hit = next(hit for hit in hits if hit is not None)
        verdict = guarded_verdict(lambda: HitVerdict(trial.add(hit)))
        flags = verdict.flags
        self._loop.show_verdict(flags, verdict.text or flags.cure or trial.text, trial=True)
        self._loop.draw(hit)
        return not flags

    def _take(self, connection: Connection) -> None:
        trigger = self._tap.trigger
        if trigger is None or any(hit.acceleration.size != trigger.n_samples for hit in self._tap.hits):
            raise self._tap.other_setup()
        self._loop.take_hits(connection, self._at_rest(trigger))

    def _at_rest(self, trigger: Trigger) -> Trigger:
        """Trigger that is armed only while the structure is at rest, where somebody taps by hand."""
        if not self._guided or self._tap.baseline is None:
            return trigger
        return replace(trigger, rest_rms=resting_rms(self._tap.baseline, trigger.pre_trigger))


def _guarded_checks(baseline: Hit, level: float | None, free_bytes: int) -> tuple[Check, ...]:
    """As `self_check`; where that fails, one line that says so."""
    try:
        return self_check(baseline, level, free_bytes)
    except Exception as error:  # noqa: BLE001 - a check warns and ends no test
        return (
            Check("self-check", False, f"it failed ({type(error).__name__}: {error}); the test goes on without it"),
        )
