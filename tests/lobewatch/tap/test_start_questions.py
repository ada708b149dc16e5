"""Turning spindle, broken cables and a loose sensor in a tap test, and the questions to the person with the hammer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from acquisition import DataError, HammeredStructure, Hammering, Hit, HitFlags, SensorInput, Structure
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.journal.tap_entry import TapEntry
from lobewatch.measurement.recording_questions import ACCEPTED_CODE, SPINDLE_TURNING, mark_accepted
from lobewatch.tap.emulated_faults import SOFT_TIP_WIDTH, EmulatedFault, EmulatedFaults
from lobewatch.tap.emulated_spindle import EMULATED_CHANNELS, build_structure
from lobewatch.tap.hit_loop import TapStopped
from lobewatch.tap.start_questions import StartQuestions
from lobewatch.tap.state import StatePublisher, TapState, TapStep
from lobewatch.tap.steady_line import find_steady_line
from tests.lobewatch.tap.conftest import RATE, Simulated

INPUTS = tuple(SensorInput(number, channel) for number, channel in enumerate(EMULATED_CHANNELS))
Watch = Callable[[TapState], None]


def record_at_rest(lines: dict[float, float], noise: float = 0.02) -> Hit:
    """Return a record of 1 s with lines of these frequencies (Hz) and rms (m/s^2)."""
    random, time = np.random.default_rng(1), np.arange(round(RATE)) / RATE
    tones = [np.sqrt(2) * rms * np.sin(2 * np.pi * frequency * time) for frequency, rms in lines.items()]
    response = random.normal(0, noise, time.size) + np.sum([0 * time, *tones], axis=0)
    signals = random.normal(0, 0.05, time.size), response
    codes = np.array([sensor.channel.encode(signal) for sensor, signal in zip(INPUTS, signals, strict=True)])
    return Hit.from_codes(codes, EMULATED_CHANNELS, RATE)


class Chain(Simulated):
    """Device that says it follows the clock, on the spindle of a machine, with faults until a time (s)."""

    follows_clock = True

    def __init__(self, folder: MachineFolder, faults: EmulatedFaults, end: float = np.inf) -> None:
        spindle, scan = folder.machine.spindle, 0
        assert spindle is not None
        structure = build_structure(spindle.build(), spindle.damping_ratio)
        widths = SOFT_TIP_WIDTH if faults.kind is EmulatedFault.SOFT_TIP else Hammering().width_range
        hitting = Hammering(width_range=widths, double_hits=0.0, overloads=0.0)
        signal = HammeredStructure(structure, RATE, np.random.default_rng(1), hitting)
        disturbed = faults.apply(signal, INPUTS, RATE)

        def sampled(_: int, n_scans: int) -> Any:
            """Go on where the last stream has ended."""
            nonlocal scan
            scan += n_scans
            return (disturbed if scan < end * RATE else signal)(scan - n_scans, n_scans)

        super().__init__(sampled, EMULATED_CHANNELS)  # type: ignore[arg-type]


def run(session: Any, *watches: Watch, until: Callable[[TapState], object]) -> None:
    """Run a session until its state is as wanted."""

    def follow() -> None:
        for watch in watches:
            watch(session.state)
        if until(session.state):
            session.stop()

    session.wakes.add(follow)
    with pytest.raises(TapStopped):
        session.run()


@pytest.mark.parametrize("rpm", [3000.0, 3600.0, 12_000.0, 13_020.0])
def test_no_hit_counts_while_the_spindle_turns(
    folder: MachineFolder, session_of: Callable[..., Any], rpm: float
) -> None:
    session = session_of(folder, lambda: Chain(folder, EmulatedFaults(turning_rpm=rpm)))
    with pytest.raises(DataError, match=SPINDLE_TURNING.code) as error:
        session.run()
    assert "rpm" in str(error.value)
    assert ("mains hum" in str(error.value)) == (rpm != 13_020.0)
    assert (session.state.hits, folder.taps()) == ((), [])


@pytest.mark.parametrize("noise", [0.02, 2.0])
@pytest.mark.parametrize(
    ("lines", "frequency"),
    [
        ({50.0: 0.3}, 50.0),
        ({50.0: 0.5, 100.0: 0.1}, 50.0),
        ({60.0: 0.5}, 60.0),
        ({24.0: 0.3}, 24.0),
        ({300.0: 1.0, 600.0: 0.2}, 300.0),
        ({50.0: 3.0, 150.0: 0.9, 250.0: 0.3, 57.0: 0.6}, 57.0),  # hum, and a spindle at 3420 rpm
        ({24.3: 0.03}, None),  # floor
        ({50.0: 0.05}, None),
        ({300.0: 0.4}, None),
        ({}, None),
    ],
)
def test_a_person_is_asked_from_the_smallest_severity_of_vibration(
    lines: dict[float, float], frequency: float | None, noise: float
) -> None:
    line = find_steady_line(record_at_rest(lines, noise))
    assert (line and round(line.frequency)) == frequency
    assert line is None or (line.is_asked and line.rms == pytest.approx(lines[round(line.frequency)], rel=0.5))


@pytest.mark.parametrize(("harmonics", "asked"), [({3: 0.3, 5: 0.1}, False), ({2: 0.2}, True), ({}, True)])
def test_only_the_odd_harmonics_of_the_mains_show_that_it_is_hum(harmonics: dict[int, float], asked: bool) -> None:
    line = find_steady_line(record_at_rest({50.0: 3.0} | {50.0 * k: 3.0 * share for k, share in harmonics.items()}))
    assert line is not None
    assert (line.frequency, line.is_asked) == (50.0, asked)
    assert "mains hum" in line.finding


@pytest.mark.parametrize("noise", [0.02, 2.0, 200.0])
def test_noise_has_no_line(noise: float) -> None:
    assert find_steady_line(record_at_rest({}, noise)) is None


def test_weak_hum_only_warns(folder: MachineFolder, session_of: Callable[..., Any]) -> None:
    session = session_of(folder, lambda: Chain(folder, EmulatedFaults(EmulatedFault.MAINS_HUM)))
    run(session, until=lambda state: state.good)
    assert {check.name for check in session.state.checks if not check.passed} >= {"hum"}


def test_an_accepted_line_is_kept_in_the_journal(folder: MachineFolder, session_of: Callable[..., Any]) -> None:
    session_of(folder, lambda: Chain(folder, EmulatedFaults(turning_rpm=3000)), accept=[SPINDLE_TURNING.code]).run()
    (entry,) = MachineFolder(folder.path).taps()
    assert (entry.asked, entry.asked_live, entry.accepted) == ((), (SPINDLE_TURNING.code,), (SPINDLE_TURNING.code,))
    logbook = Logbook.open(folder.path)
    assert logbook.questions == {}
    assert ACCEPTED_CODE in [remark.code for remark in logbook.measurement(entry.id).remarks]


def test_a_question_of_a_newer_version_is_no_error() -> None:
    known = TapEntry("t", "", 0, "2026-06-01T08:00:00+00:00", "R", "x", "", asked_live=("new", SPINDLE_TURNING.code))
    entry = TapEntry.from_line(known.line)
    assert entry == known
    assert [remark.code for remark in mark_accepted((), entry)] == [SPINDLE_TURNING.code]


@pytest.mark.parametrize("rpm", [0.0, 12_000.0])
def test_a_person_confirms_tool_and_spindle_once(
    folder: MachineFolder, session_of: Callable[..., Any], rpm: float
) -> None:
    asked: list[str] = []

    def answer(state: TapState) -> None:
        if state.word is TapStep.ASK and state.choices and state.reason not in asked:
            asked.append(state.reason)
            session.choose(state.choices[0].key)

    session = session_of(folder, lambda: Chain(folder, EmulatedFaults(turning_rpm=rpm)), asks=True)
    run(session, answer, until=lambda state: state.good)
    assert len(asked) == 1 + bool(rpm)
    assert "reference" in asked[0]
    assert session.questions.accepted == [SPINDLE_TURNING.code] * bool(rpm)
    assert (session.state.choices, session.questions.is_confirmed) == ((), True)


def test_the_test_goes_on_once_the_spindle_is_stopped(folder: MachineFolder, session_of: Callable[..., Any]) -> None:
    shown: list[TapStep] = []
    session = session_of(folder, lambda: Chain(folder, EmulatedFaults(turning_rpm=12_000), end=3.0), asks=True)
    session.questions.is_confirmed = True
    run(session, lambda state: shown.append(state.word), until=lambda state: state.good)
    assert TapStep.ASK in shown
    assert (session.questions.asked, session.questions.accepted) == ([], [])


def test_an_answer_that_nobody_asked_for_is_rejected(folder: MachineFolder, session_of: Callable[..., Any]) -> None:
    with pytest.raises(ValueError, match="start"):
        session_of(folder, lambda: Chain(folder, EmulatedFaults())).choose("start")


def test_two_presses_answer_one_question() -> None:
    publisher = StatePublisher(TapState(0, TapStep.CHECKING, "m", "x", wanted=3), lambda: 0.0)
    questions = StartQuestions(publisher, "R", [], asks=True)

    def press_twice() -> None:
        for _ in range(2):
            questions.answer(publisher.state.choices[0].key)

    records = 0

    def record() -> Hit:
        nonlocal records
        records += 1
        return turning if records < 3 else resting

    turning, resting = record_at_rest({200.0: 8.0}), record_at_rest({})
    questions.confirm(press_twice)
    assert questions.settle(turning, record) is resting
    assert (questions.asked, questions.accepted, records) == ([], [], 3)


@pytest.mark.parametrize(
    ("faults", "flag"),
    [
        (EmulatedFaults(turning_rpm=12_000, begin=3.0), HitFlags.STEADY_VIBRATION),
        pytest.param(EmulatedFaults(turning_rpm=13_020, begin=3.0), HitFlags.STEADY_VIBRATION, marks=pytest.mark.long),
        (EmulatedFaults(EmulatedFault.RESPONSE_CABLE, begin=3.0), HitFlags.NO_RESPONSE),
        pytest.param(EmulatedFaults(EmulatedFault.OPEN_INPUT, begin=3.0), HitFlags.NO_RESPONSE, marks=pytest.mark.long),
        (EmulatedFaults(EmulatedFault.SATURATED, begin=3.0), HitFlags.NO_RESPONSE),
        (EmulatedFaults(EmulatedFault.SWAPPED, begin=3.0), HitFlags.SWAPPED_CHANNELS),
        (EmulatedFaults(EmulatedFault.SOFT_TIP), HitFlags.NARROW_BAND),
        (EmulatedFaults(EmulatedFault.FALLING_SENSOR, begin=3.0), HitFlags.INCONSISTENT),
    ],
)
def test_a_fault_of_the_chain_rejects_hits_with_its_cause(
    folder: MachineFolder, session_of: Callable[..., Any], faults: EmulatedFaults, flag: HitFlags
) -> None:
    session = session_of(folder, lambda: Chain(folder, faults))
    run(session, until=lambda state: sum(bool(hit.flags) for hit in state.hits) == 2)
    assert {hit.flags for hit in session.state.hits} <= {HitFlags.OK, flag}


def test_a_hit_that_the_hammer_does_not_show_is_named(folder: MachineFolder, session_of: Callable[..., Any]) -> None:
    session = session_of(folder, lambda: Chain(folder, EmulatedFaults(EmulatedFault.FORCE_CABLE)))
    run(session, until=lambda state: "hammer cable" in state.reason)
    assert "20 N" in session.state.reason
    assert session.state.hits == ()


@pytest.mark.parametrize(("rpm", "is_left_open"), [(964.0, True), (3000.0, True), (0.0, False)])
def test_a_spindle_that_turns_after_the_last_hit_leaves_its_question_open(rpm: float, is_left_open: bool) -> None:
    questions = StartQuestions(StatePublisher(TapState(0, TapStep.CHECKING, "m")), "R", (), asks=False)
    for _ in range(2):
        questions.check_after(record_at_rest({rpm / 60: 2.0} if rpm else {}), record_at_rest({}))
    assert questions.left_open == [SPINDLE_TURNING.code] * is_left_open


@pytest.mark.parametrize(("half_life", "is_left_open"), [(10.0, True), (0.5, False)])
def test_a_response_that_still_decays_is_no_turning_spindle(half_life: float, is_left_open: bool) -> None:
    record, time = record_at_rest({}), np.arange(round(RATE)) / RATE
    line = 3.0 * 0.5 ** (time / half_life) * np.sin(2 * np.pi * 20.0 * time)
    codes = np.stack([INPUTS[0].channel.encode(record.force), INPUTS[1].channel.encode(record.acceleration + line)])
    questions = StartQuestions(StatePublisher(TapState(0, TapStep.CHECKING, "m")), "R", (), asks=False)
    questions.check_after(Hit.from_codes(codes, EMULATED_CHANNELS, RATE), record)
    assert questions.left_open == [SPINDLE_TURNING.code] * is_left_open


@pytest.mark.parametrize(
    ("before", "after", "is_left_open"),
    [(0.0, 0.2, True), (0.0, 0.08, False), (0.06, 0.2, False), (0.02, 0.2, True), (0.2, 0.2, False)],
)
def test_a_weak_line_that_was_not_there_before_the_first_hit_is_asked_about(
    before: float, after: float, is_left_open: bool
) -> None:
    """0.2 m/s^2 at 320 Hz are 0.1 mm/s."""
    questions = StartQuestions(StatePublisher(TapState(0, TapStep.CHECKING, "m")), "R", (), asks=False)
    questions.check_after(*(record_at_rest({320.0: rms}, 0.1) for rms in (after, before)))
    assert questions.left_open == [SPINDLE_TURNING.code] * is_left_open


def test_a_strong_line_is_asked_about_even_if_it_was_there_before() -> None:
    questions = StartQuestions(StatePublisher(TapState(0, TapStep.CHECKING, "m")), "R", (), asks=False)
    questions.check_after(record_at_rest({16.0: 2.0}), record_at_rest({16.0: 2.0}))
    assert questions.left_open == [SPINDLE_TURNING.code]


def test_an_accepted_line_after_the_last_hit_asks_nothing() -> None:
    questions = StartQuestions(
        StatePublisher(TapState(0, TapStep.CHECKING, "m")), "R", [SPINDLE_TURNING.code], asks=False
    )
    questions.check_after(record_at_rest({16.0: 2.0}), record_at_rest({}))
    assert questions.left_open == []


def test_noise_shows_a_line_below_one_converter_step() -> None:
    step = abs(EMULATED_CHANNELS[-1].scale)
    quiet, noisy = (record_at_rest({25.0: 0.6 * step}, noise * step) for noise in (0.02, 0.8))
    assert find_steady_line(quiet) is None
    assert find_steady_line(noisy) is not None


class SlowHands(Simulated):
    """Hits every 4 s on a spindle that turns at 15 Hz from a time (s) on."""

    def __init__(self, begin: float) -> None:
        structure = Structure(np.array([800.0]), np.array([0.03]), np.array([2e7]))
        hitting = Hammering(interval_range=(4.0, 4.0), double_hits=0.0, overloads=0.0)
        hammered = HammeredStructure(structure, RATE, np.random.default_rng(1), hitting)

        scan = 0

        def signal(_: int, n_scans: int) -> Any:
            """Go on where the last stream has ended."""
            nonlocal scan
            scan += n_scans
            time = (scan - n_scans + np.arange(n_scans)) / RATE
            return hammered(scan - n_scans, n_scans) + np.outer(
                [0, 1], np.sin(2 * np.pi * 15.0 * time) * (time >= begin)
            )

        super().__init__(signal, EMULATED_CHANNELS)  # type: ignore[arg-type]


@pytest.mark.parametrize(("begin", "is_left_open"), [(6.0, True), pytest.param(np.inf, False, marks=pytest.mark.long)])
def test_a_spindle_that_starts_slowly_during_the_test_leaves_a_question(
    folder: MachineFolder, session_of: Callable[..., Any], begin: float, is_left_open: bool
) -> None:
    session_of(folder, lambda: SlowHands(begin)).run()
    (entry,) = MachineFolder(folder.path).taps()
    assert (entry.asked, entry.accepted) == ((SPINDLE_TURNING.code,) * is_left_open, ())
    asked = Logbook.open(folder.path).history.questions.get(entry.id, ())
    assert (SPINDLE_TURNING.code in asked) == is_left_open
