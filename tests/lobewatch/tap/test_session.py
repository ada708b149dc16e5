"""Live tap test as a whole: steps, result, failures, stopping and resuming."""

from __future__ import annotations

import errno
import json
import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from itertools import groupby
from typing import Any

import numpy as np
import pytest

from acquisition import Channel, Circumstances, DataError, HammeredStructure, TapTest, new_tap_id, write_hit
from lobewatch.logbook import Logbook
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.hit_loop import TapStopped
from lobewatch.tap.session import TapSession
from lobewatch.tap.state import TapState, TapStep
from modal import Mode, synthesize_frf

Tapper = Callable[..., HammeredStructure]
Pair = tuple[Channel, Channel]
Simulate = Callable[..., Any]
"""Makes the device of conftest.py."""
OpenSession = Callable[..., TapSession]


def test_the_words_of_a_test_and_its_result(
    folder: MachineFolder, tapper: Tapper, channels: Pair, simulated: Simulate, session_of: OpenSession
) -> None:
    states: list[TapState] = []
    session = session_of(folder, lambda: simulated(tapper(), channels), states.append)
    tap = session.run()
    assert tap.required_frf.n_averages == 10
    words = [word for word, _ in groupby(state.word for state in states)]
    assert words[0] is TapStep.CHECKING
    assert words[-1] is TapStep.DONE
    cycle = "".join({TapStep.TAP: "T", TapStep.WAIT: "W", TapStep.GOOD: "G"}.get(word, "") for word in words)
    assert re.fullmatch(r"W?T?(WG(W?T)?)+", cycle), cycle
    assert [state.revision for state in states] == sorted(state.revision for state in states)
    done = session.state
    assert (done.good, len(done.hits)) == (10, 10)
    assert [check.name for check in done.checks if not check.passed] == ["calibration"]
    assert done.outcome is not None
    assert done.outcome.status == "warn"
    assert done.outcome.next_step.startswith("Tap direction y")
    assert "tool reference, direction x" in done.title
    assert done.plots is not None
    assert done.plots.mean is not None
    assert done.plots.coherence is not None
    assert {len(curve) for curve in (done.plots.frequency, done.plots.mean, done.plots.coherence)} == {
        done.plots.frequency.size
    }
    assert session.measurement.tap_id == tap.id
    assert [entry.id for entry in folder.taps()] == [tap.id]
    first = next(state for state in states if state.good == 1)
    assert first.mean_change is None
    assert states[-1].mean_change is not None


def test_a_saved_test_is_called_saved_whatever_is_wrong_with_the_others(
    folder: MachineFolder,
    tapper: Tapper,
    channels: Pair,
    monkeypatch: pytest.MonkeyPatch,
    simulated: Simulate,
    session_of: OpenSession,
) -> None:
    def damaged(*_: object) -> None:
        raise DataError("taps/older.h5: altered since it was written")

    monkeypatch.setattr("lobewatch.tap.session.Logbook.measurement", damaged)
    session = session_of(folder, lambda: simulated(tapper(), channels))
    with pytest.raises(DataError, match=r"taps/older\.h5") as told:
        session.run()
    (entry,) = folder.taps()
    assert entry.id in str(told.value)
    assert session.state.word is TapStep.FAILED


def test_a_saved_test_that_is_damaged_at_once_is_reported_without_the_other_damage(
    folder: MachineFolder,
    tapper: Tapper,
    channels: Pair,
    monkeypatch: pytest.MonkeyPatch,
    simulated: Simulate,
    session_of: OpenSession,
) -> None:
    def damage(logbook: Logbook, *_: object) -> list[str]:
        for path in logbook.folder.path.glob("taps/*.h5"):
            path.write_bytes(path.read_bytes()[:-1000])
        return []

    session_of(folder, lambda: simulated(tapper(), channels)).run()
    (older,) = folder.taps()
    monkeypatch.setattr("lobewatch.tap.session.Logbook.accept", damage)
    session = session_of(folder, lambda: simulated(tapper(), channels))
    with pytest.raises(DataError, match=r"taps/.*\.h5") as told:
        session.run()
    (newer,) = (path.stem for path in folder.path.glob("taps/*.h5") if path.stem != older.id)
    said = str(told.value)
    assert older.id not in said
    assert f"taps/{newer}.h5" in said


@pytest.mark.parametrize(
    ("failure", "told", "fact"),
    [
        (OSError(errno.ENOSPC, "No space left on device", "m/spool/x/0003.h5"), DataError, "m/spool/x/0003.h5"),
        (MemoryError("no room"), RuntimeError, "MemoryError: no room"),
    ],
)
def test_a_full_disk_or_a_mistake_of_ours_is_reported_and_costs_no_hit(
    failure: Exception,
    told: type[Exception],
    fact: str,
    folder: MachineFolder,
    tapper: Tapper,
    channels: Pair,
    monkeypatch: pytest.MonkeyPatch,
    simulated: Simulate,
    session_of: OpenSession,
) -> None:
    def failing(*arguments: Any) -> None:
        if session.state.good == 3:
            raise failure
        write_hit(*arguments)

    monkeypatch.setattr("lobewatch.tap.tap_in_progress.write_hit", failing)
    session = session_of(folder, lambda: simulated(tapper(), channels))
    with pytest.raises(told, match=fact) as raised:
        session.run()
    assert session.state.word is TapStep.FAILED
    assert session.state.reason == str(raised.value)
    assert "Errno" not in session.state.reason
    monkeypatch.undo()
    session = session_of(folder, lambda: simulated(tapper(2), channels))
    assert len(session.run().hits) == 10
    assert sum(hit.earlier for hit in session.state.hits) == 3


def test_a_full_disk_is_reported_before_the_first_hit(
    folder: MachineFolder,
    tapper: Tapper,
    channels: Pair,
    monkeypatch: pytest.MonkeyPatch,
    simulated: Simulate,
    session_of: OpenSession,
) -> None:
    class Usage:
        free = 1_000_000

    monkeypatch.setattr("lobewatch.machine.folder_lock.shutil.disk_usage", lambda _: Usage)
    session = session_of(folder, lambda: simulated(tapper(), channels))
    with pytest.raises(DataError, match=r"1 MB.*50 MB"):
        session.run()
    assert session.state.hits == ()


def test_a_disk_that_fills_up_meanwhile_does_not_end_the_test(
    folder: MachineFolder,
    tapper: Tapper,
    channels: Pair,
    monkeypatch: pytest.MonkeyPatch,
    simulated: Simulate,
    session_of: OpenSession,
) -> None:
    reserve = folder.spool / ".reserve"
    held: list[int] = []

    def filled_by_others(*arguments: Any) -> None:
        if reserve.exists() and session.state.good == 3:
            held.append(reserve.stat().st_blocks * 512)
            raise OSError(errno.ENOSPC, "No space left on device", "m/spool/x/0003.h5")
        write_hit(*arguments)

    monkeypatch.setattr("lobewatch.tap.tap_in_progress.write_hit", filled_by_others)
    session = session_of(folder, lambda: simulated(tapper(), channels))
    assert len(session.run().hits) == 10
    assert held[0] >= 50_000_000
    assert list(folder.spool.iterdir()) == []


def test_a_stopped_test_is_resumed_by_the_set_up_it_began_with(
    open_folder: MachineFolder, tapper: Tapper, channels: Pair, simulated: Simulate, session_of: OpenSession
) -> None:
    def stop(state: TapState) -> None:
        if state.good == 4:
            session.stop()

    session = session_of(open_folder, lambda: simulated(tapper(), channels), stop)
    with pytest.raises(TapStopped, match="4"):
        session.run()
    (setup,) = open_folder.spool.glob("*/setup.json")
    level = json.loads(setup.read_text())["level"]
    assert 10 < level < 40
    states: list[TapState] = []
    again = session_of(open_folder, lambda: simulated(tapper(2), channels), states.append)
    tap = again.run()
    assert not any(state.trial for state in states)
    assert next(check for check in again.state.checks if check.name == "force noise").text.endswith(f"{level:g} N")
    assert "4 of 10" in again.state.resumed
    assert [hit.earlier for hit in again.state.hits] == [True] * 4 + [False] * 6
    assert len(tap.hits) == 10
    assert not list(open_folder.spool.iterdir())


def test_there_is_no_measurement_before_the_end(
    folder: MachineFolder, tapper: Tapper, channels: Pair, simulated: Simulate, session_of: OpenSession
) -> None:
    session = session_of(folder, lambda: simulated(tapper(), channels))
    with pytest.raises(ValueError, match=r"run\(\)"):
        _ = session.measurement


def test_a_clock_behind_the_newest_test_is_asked_about_and_accepted(
    folder: MachineFolder, tapper: Tapper, channels: Pair, simulated: Simulate, session_of: OpenSession
) -> None:
    about = Circumstances("m", datetime.now(UTC) + timedelta(hours=1), "reference")
    folder.commit(
        TapTest(new_tap_id(about), about, synthesize_frf([Mode(1713.0, 0.03, 3.5e7)], np.arange(4.0, 4000.0, 4.0)))
    )
    session = session_of(folder, lambda: simulated(tapper(), channels), accept=["clock-behind", "other-band"])
    tap = session.run()
    assert folder.taps()[0].id == tap.id
    assert folder.taps()[0].asked == ("clock-behind",)
    told = [(remark.code, remark.about) for remark in session.measurement.remarks]
    assert ("accepted", "clock-behind") in told
    assert session.unasked == ["other-band"]
