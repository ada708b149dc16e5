"""Live tap test from the self-check to the result."""

import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from functools import partial

import acquisition
from acquisition import CROSS_TAP, Circumstances, Conditions, DataError, Device, DeviceError, Remark, TapTest
from acquisition.errors import PERMISSION_ERRNOS, format_os_error, join_sentences
from dsm import format_rounded
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_lock import DiskReserve
from lobewatch.machine.settings.display_units import LENGTH
from lobewatch.measurement import Measurement
from lobewatch.measurement.recording_questions import check_question_codes, find_device_questions, find_open_questions
from lobewatch.monitoring import SeriesStatus
from lobewatch.monitoring.drop_text import describe_drop
from lobewatch.monitoring.status_rules import STATUS_BY_CODE
from lobewatch.tap.device_connection import DeviceOpener
from lobewatch.tap.hit_loop import TapPhases, TapStopped
from lobewatch.tap.start_questions import StartQuestions
from lobewatch.tap.state import Outcome, ProgramVerdict, StatePublisher, TapState, TapStep
from lobewatch.tap.tap_in_progress import CrossTapResult, TapInProgress, begin_tap, commit_cross_tap
from lobewatch.verdicts.program_remarks import CROSS_NOT_TAPPED_CODE


class TapSession:
    """Tap test of one machine. `run` it in one thread. `state`, `undo` and `stop` are for every thread.

    Parameters
    ----------
    folder
        Machine folder.
    open_device
        Function that opens the device.
    circumstances
        Operator, machine, tool, direction and time.
    resume
        Whether to resume an interrupted test of the same tool and direction.
    guided
        Whether a person taps. False omits self-check, re-arming by decay, curves, the time to take back the last hit,
        and the outcome.
    accept
        Codes of questions about the recording that are answered already.
    asks
        Whether a person can answer questions before the first hit.
    clock
        Function that returns a monotonic time (s).
    sleep
        Function that waits (s).

    Raises
    ------
    ValueError
        A code in `accept` does not exist.
    """

    def __init__(
        self,
        folder: MachineFolder,
        open_device: Callable[[], Device],
        circumstances: Circumstances,
        *,
        resume: bool = True,
        guided: bool = True,
        accept: Sequence[str] = (),
        asks: bool = False,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._folder, self._about, self._resume, self._guided = folder, circumstances, resume, guided
        about = f"{circumstances.machine}, tool {circumstances.tool}, direction {circumstances.direction}"
        first = TapState(0, TapStep.CHECKING, about, circumstances.direction, wanted=folder.machine.tap.hits)
        self._publisher = StatePublisher(first, clock)
        codes = check_question_codes(accept)
        self.questions = StartQuestions(self._publisher, circumstances.tool, codes, asks=asks)
        """Questions before the first hit, and the accepted codes."""
        opener, publisher = partial(self._open, open_device), self._publisher
        self._phases = TapPhases(folder, opener, publisher, questions=self.questions, guided=guided, sleep=sleep)
        self._measurement: Measurement | None = None
        self.wakes = self._publisher.wakes
        """Functions called after every change by the thread of the test. None may take time."""
        self.unasked: Sequence[str] = ()
        """Codes of `accept` that the finished test does not ask."""
        self.saved: Sequence[str] = ()
        """Ids of what the finished test has saved: its own, then that of the cross tap."""
        self.across: CrossTapResult | None = None
        """Cross tap that the same hits give, None if no second sensor recorded them."""

    @property
    def state(self) -> TapState:
        """Newest state of the test, replaced and never changed."""
        return self._publisher.state

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Remarks on the finished test: whether its sample rate is verified."""
        return self._phases.remarks

    @property
    def measurement(self) -> Measurement:
        """Measurement of the finished test. ValueError before the end."""
        if self._measurement is None:
            raise ValueError("the tap test is not finished. The measurement is available after run() has returned.")
        return self._measurement

    def undo(self) -> None:
        """Take back the last good hit. Again: the one before."""
        self._phases.undos.release()

    def decide(self, number: int | None, *, accept: bool) -> None:
        """Accept or reject a hit.

        Parameters
        ----------
        number
            Number of the hit, from 1. None for the last hit.
        accept
            True to accept a rejected hit, False to reject an accepted one.
        """
        self._phases.decisions.put((number, accept))

    def stop(self) -> None:
        """End the test now. `run` raises TapStopped, and the hits so far stay stored."""
        self._phases.stopping.set()

    def choose(self, key: str, tool: str = "") -> None:  # noqa: ARG002 - as of a visit, which has a next tool
        """Answer the question that is shown before the first hit.

        Parameters
        ----------
        key
            Key of a choice.
        tool
            Not used: nothing comes after a single test.

        Raises
        ------
        ValueError
            The choice is not shown.
        """
        self.questions.answer(key)

    def run(self) -> TapTest:
        """Take hits until enough are good, commit the test and return it.

        Raises
        ------
        DeviceError
            There is no device at the start. Later it is awaited.
        DataError
            Another program writes to the folder, or the disk is full.
        ValueError
            The interrupted test was recorded with another set-up.
        TapStopped
            `stop` was called.
        """
        try:
            with self._folder.locked(), DiskReserve(self._folder.path) as reserve:
                tap = self._begin()
                tap.reserve = reserve
                if tap.missing:
                    self._phases.run(tap)
                reserve.release()
                return self._finish(tap)
        except TapStopped:
            raise
        except Exception as error:
            failure = _to_operator_error(error)
            self._publisher.show(word=TapStep.FAILED, reason=str(failure))
            if failure is error:
                raise
            raise failure from error

    def _open(self, open_device: Callable[[], Device]) -> Device:
        """Open the device. DataError for an emulated one in a machine with real tap tests, unless that is accepted."""
        device = open_device()
        asked = find_device_questions(self._folder, device.identity)
        if set(asked) <= set(self.questions.accepted):
            return device
        device.close()
        cure = f"Tap another machine, or add accept_questions.codes {asked[0]} to store it here"
        finding = f"this device is emulated, but {self._folder.path} has real tap tests"
        raise DataError(join_sentences(finding, cure))

    def _begin(self) -> TapInProgress:
        """Return the interrupted test, or a new one."""
        tap, texts = begin_tap(self._folder, self._about, self._resume), []
        if tap.hits:
            begun = f"{tap.circumstances.created:%Y-%m-%d %H:%M} UTC"
            texts.append(f"Continuing the test of {begun} with {tap.progress}")
        if tap.damaged:
            texts.append(f"Damaged files set aside: {', '.join(str(path) for path in tap.damaged)}")
        texts += tap.not_resumed
        if texts:
            self._publisher.show(**tap.shown, resumed=join_sentences(*texts))
        return tap

    def _finish(self, in_progress: TapInProgress) -> TapTest:
        """Average, commit and evaluate the test."""
        self._publisher.show(word=TapStep.DONE, reason="The result is being computed.", levels=None, hit_change=None)
        tap = in_progress.finish()
        self._publisher.show(**in_progress.shown)
        logbook = Logbook(self._folder)
        now = datetime.now(UTC) if self._guided else None
        answered = self.questions.asked
        commit = partial(logbook.commit, now=now, asked=self.questions.left_open, answered=answered)
        commit(tap)
        self.across = commit_cross_tap(in_progress, commit)
        self.saved = [tap.id, *([self.across.tap_id] if self.across and self.across.tap_id else [])]
        try:
            self.unasked = logbook.accept(
                self.saved, [code for code in self.questions.accepted if code not in answered]
            )
            self._measurement = logbook.measurement(tap.id)
            outcome = build_outcome(logbook, self._measurement, self.across) if self._guided else None
        except (ArithmeticError, KeyError, OSError, ValueError) as error:
            texts = [str(remark) for remark in logbook.remarks if tap.id in remark.about] or [str(error)]
            if isinstance(error, OSError) and error.errno:
                texts = [format_os_error(error)]
            raise DataError(f"{tap.id} is saved but cannot be evaluated: {join_sentences(*texts)}") from error
        self._publisher.show(reason="", outcome=outcome)
        return tap


def _to_operator_error(error: Exception) -> Exception:
    """Return an error that the operator can act on, also for a failure of the system or the program."""
    if isinstance(error, DeviceError | ValueError):
        return error
    kept = "Repeat the command to continue with the hits so far"
    if isinstance(error, OSError):
        cure = "Get write permission for this folder" if error.errno in PERMISSION_ERRNOS else kept
        if isinstance(error, FileNotFoundError):
            cure = "Then repeat the command"
        return DataError(join_sentences(format_os_error(error), cure))
    return RuntimeError(join_sentences(f"lobewatch has failed ({type(error).__name__}: {error})", kept))


def build_outcome(logbook: Logbook, measurement: Measurement, across: CrossTapResult | None = None) -> Outcome:
    """Build the result of a test for the operator: machine status, measured values and next step.

    across: result of the cross tap that its hits give.
    """
    standing = logbook.status(measurement.time)
    series = standing.series_of(measurement.tool, measurement.direction)
    questions = find_open_questions(measurement.remarks)
    remarks = [remark for remark in measurement.remarks if remark not in questions]
    remarks += acquisition.merge_remarks(standing.remarks)
    remarks += [remark for remark in logbook.remarks if remark.code not in STATUS_BY_CODE]
    check = logbook.chain_check(measurement.tap_id)
    texts = [*_format_values(measurement, series), *([across.text] if across else [])]
    texts += [f"Sensor chain: {check.text}."] if check.evidence is not None else []
    texts += [remark.finding if remark.finding[-1] in ".!?" else f"{remark.finding}." for remark in remarks]
    verdicts = logbook.verdicts()
    programs = [
        ProgramVerdict(f"{cut.name} ({cut.speed_rpm:g} rpm, {LENGTH.text(cut.depth_mm)})", verdict.stability.value)
        for verdict in verdicts
        if (cut := verdict.program)
    ]
    of_tool = [verdict.remarks for verdict in verdicts if verdict.program.tool == measurement.tool]
    asks_across = any(remark.code == CROSS_NOT_TAPPED_CODE for remarks in of_tool for remark in remarks)
    return Outcome(standing.status, texts, standing.next_step, standing.is_early, programs, asks_across)


def _format_values(measurement: Measurement, series: SeriesStatus | None) -> list[str]:
    if (mode := measurement.followed) is None:
        return []
    f_std, zeta_std, k_std = mode.standard_error.tolist()  # for the digits: they do not contain reclamping
    against = "first test of this tool and direction"
    if find_open_questions(measurement.remarks):
        against = "but the test has an open question"
    elif series is not None and not series.is_baseline:
        drop = series.drop
        against = describe_drop(drop.value, drop.half_width, is_proven=series.is_change_proven)
    damping = format_rounded(mode.damping_ratio, zeta_std, 0.01)
    stiffness = f"Stiffness {format_rounded(mode.stiffness, k_std, 1e6)} N/um, damping {damping} %."
    if not mode.has_stiffness:
        stiffness = f"Damping {damping} %. Stiffness is unknown because no force was measured."
    return [f"Frequency {format_rounded(mode.frequency, f_std)} Hz, {against}.", stiffness]


def plan_session(
    folder: MachineFolder,
    *,
    port: str = "",
    tool: str = "",
    direction: str = "x",
    operator: str = "",
    resume: bool = True,
    accept: Sequence[str] = (),
    asks: bool = False,
    conditions: Conditions = acquisition.UNKNOWN_CONDITIONS,
) -> TapSession:
    """Plan a session of today. machine.toml supplies what is left empty.

    Parameters
    ----------
    folder
        Machine folder.
    port
        Port of the device.
    tool
        Name of the tool.
    direction
        Direction: "x", "y" or "xy".
    operator
        Name of the operator.
    resume
        Whether to resume an interrupted test of the same tool and direction.
    accept
        Codes of questions about the recording that are answered already.
    asks
        Whether a person can answer questions before the first hit.
    conditions
        Conditions of today.

    Returns
    -------
    TapSession
        Session that is ready to run.

    Raises
    ------
    ValueError
        There is no port, or the direction needs a force sensor.
    """
    machine = folder.machine
    port = port or machine.daq.port
    if not port:
        raise ValueError(f"DAQ port missing. Give plan_session.port, or set port in [daq] of {folder.toml}.")
    tool, wanted = tool or machine.tap.tool, acquisition.parse_direction(direction)
    if wanted == CROSS_TAP and machine.tap.hammer == "none":
        raise ValueError("direction xy needs a force sensor. Tap only x and y.")
    conditions = conditions.with_defaults(machine.tap.conditions(tool))
    what = machine.machine.name, datetime.now(UTC), tool, wanted, operator
    about = Circumstances(*what, folder.toml_text, conditions=conditions)
    return TapSession(folder, DeviceOpener(machine.daq, port).open, about, resume=resume, accept=accept, asks=asks)
