"""A spindle that turns before or during a tap test, and the questions to the person with the hammer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from acquisition import DataError, HammeredStructure, Hammering, HitFlags, SensorInput
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.measurement.recording_questions import SPINDLE_TURNING
from lobewatch.tap.emulated_faults import EmulatedFault, EmulatedFaults
from lobewatch.tap.emulated_spindle import EMULATED_CHANNELS, build_structure
from lobewatch.tap.state import TapState, TapStep
from tests.lobewatch.tap.conftest import RATE, Simulated

INPUTS = tuple(SensorInput(number, channel) for number, channel in enumerate(EMULATED_CHANNELS))


def device(folder: MachineFolder, faults: EmulatedFaults, end: float = np.inf) -> Simulated:
    """Return a device on the spindle of a machine, with faults until a time (s). It seems to follow the clock."""
    spindle = folder.machine.spindle
    assert spindle is not None
    structure = build_structure(spindle.build(), spindle.damping_ratio)
    hitting = Hammering(double_hits=0.0, overloads=0.0)
    signal = HammeredStructure(structure, RATE, np.random.default_rng(1), hitting)
    disturbed = faults.apply(signal, INPUTS, RATE)
    made = Simulated(lambda first, n: (disturbed if first < end * RATE else signal)(first, n), EMULATED_CHANNELS)  # type: ignore[arg-type]
    made.follows_clock = True
    return made


@pytest.mark.parametrize("rpm", [3000.0, 3600.0, 12_000.0, 13_020.0])
def test_no_hit_counts_while_the_spindle_turns(
    folder: MachineFolder, session_of: Callable[..., Any], rpm: float
) -> None:
    session = session_of(folder, lambda: device(folder, EmulatedFaults(turning_rpm=rpm)))
    with pytest.raises(DataError, match=SPINDLE_TURNING.code) as error:
        session.run()
    assert "rpm" in str(error.value)
    assert ("mains hum" in str(error.value)) == (rpm != 13_020.0)
    assert (session.state.hits, folder.taps()) == ((), [])


def test_weak_hum_only_warns(folder: MachineFolder, session_of: Callable[..., Any]) -> None:
    session = session_of(folder, lambda: device(folder, EmulatedFaults(EmulatedFault.MAINS_HUM)))
    session.run()
    assert {check.name for check in session.state.checks if not check.passed} >= {"hum"}
    assert len(folder.taps()) == 1


def test_an_accepted_line_is_kept_in_the_journal(folder: MachineFolder, session_of: Callable[..., Any]) -> None:
    turning = EmulatedFaults(turning_rpm=3000)
    session_of(folder, lambda: device(folder, turning), accept=[SPINDLE_TURNING.code]).run()
    (entry,) = folder.taps()
    assert SPINDLE_TURNING.code in entry.asked
    assert SPINDLE_TURNING.code in entry.accepted
    assert not Logbook(folder).questions


def answers_to(session_of: Callable[..., Any], folder: MachineFolder, made: Simulated) -> tuple[Any, list[str]]:
    """Run a session whose person answers each question once, and return it with the shown questions."""
    asked: list[str] = []

    def watch(state: TapState) -> None:
        if state.word is TapStep.ASK and state.choices and state.reason not in asked:
            asked.append(state.reason)
            session.choose(state.choices[0].key)

    session = session_of(folder, lambda: made, asks=True)
    session.wakes.add(lambda: watch(session.state))
    session.run()
    return session, asked


def test_a_person_confirms_tool_and_spindle_once(folder: MachineFolder, session_of: Callable[..., Any]) -> None:
    _, asked = answers_to(session_of, folder, device(folder, EmulatedFaults()))
    assert len(asked) == 1
    assert "reference" in asked[0]
    assert folder.taps()[0].asked == ()


def test_a_person_says_that_the_spindle_stands_still(folder: MachineFolder, session_of: Callable[..., Any]) -> None:
    session, asked = answers_to(session_of, folder, device(folder, EmulatedFaults(turning_rpm=12_000)))
    assert len(asked) == 2
    assert folder.taps()[0].accepted == (SPINDLE_TURNING.code,)
    assert session.state.choices == ()


def test_the_test_goes_on_once_the_spindle_is_stopped(folder: MachineFolder, session_of: Callable[..., Any]) -> None:
    made = device(folder, EmulatedFaults(turning_rpm=12_000), end=3.0)
    shown: list[TapStep] = []
    session = session_of(folder, lambda: made, asks=True)
    session.questions.is_confirmed = True
    session.wakes.add(lambda: shown.append(session.state.word))
    session.run()
    assert TapStep.ASK in shown
    assert folder.taps()[0].asked == ()


def test_an_answer_that_nobody_asked_for_is_rejected(folder: MachineFolder, session_of: Callable[..., Any]) -> None:
    with pytest.raises(ValueError, match="start"):
        session_of(folder, lambda: device(folder, EmulatedFaults())).choose("start")


def test_a_spindle_that_starts_during_the_test_rejects_its_hits(
    folder: MachineFolder, session_of: Callable[..., Any]
) -> None:
    made = device(folder, EmulatedFaults(turning_rpm=3000, begin=3.0), end=6.0)
    session = session_of(folder, lambda: made)
    session.run()
    flags = [hit.flags for hit in session.state.hits]
    assert HitFlags.STEADY_VIBRATION in flags
    assert set(flags) <= {HitFlags.OK, HitFlags.STEADY_VIBRATION, HitFlags.SURPLUS}


@pytest.mark.parametrize(
    ("fault", "flag"),
    [
        (EmulatedFault.RESPONSE_CABLE, HitFlags.NO_RESPONSE),
        (EmulatedFault.OPEN_INPUT, HitFlags.NO_RESPONSE),
        (EmulatedFault.SATURATED, HitFlags.NO_RESPONSE),
        (EmulatedFault.SWAPPED, HitFlags.SWAPPED_CHANNELS),
        (EmulatedFault.SOFT_TIP, HitFlags.NARROW_BAND),
        (EmulatedFault.FALLING_SENSOR, HitFlags.INCONSISTENT),
    ],
)
def test_a_fault_of_the_chain_rejects_hits_with_its_cause(
    folder: MachineFolder, session_of: Callable[..., Any], fault: EmulatedFault, flag: HitFlags
) -> None:
    faults = EmulatedFaults(fault, begin=2.5)
    made = device(folder, faults, end=8.0)
    if fault is EmulatedFault.SOFT_TIP:
        made._signal.__closure__  # noqa: B018
    session = session_of(folder, lambda: made)
    session.run()
    assert {hit.flags for hit in session.state.hits if hit.flags and not hit.flags & HitFlags.SURPLUS} == {flag}


def test_a_hit_that_the_hammer_does_not_show_is_named(folder: MachineFolder, session_of: Callable[..., Any]) -> None:
    made = device(folder, EmulatedFaults(EmulatedFault.FORCE_CABLE, begin=2.0), end=4.0)
    reasons: list[str] = []
    session = session_of(folder, lambda: made)
    session.wakes.add(lambda: reasons.append(session.state.reason))
    session.run()
    assert any("hammer cable" in reason and "20 N" in reason for reason in reasons)
