"""The live tap test as a whole: words, trial hits, undo, stopping, unplugging in every state, a slow disk."""

from __future__ import annotations

import errno
import json
import re
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime
from itertools import count, groupby, takewhile
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquisition import (
    Block,
    Channel,
    Circumstances,
    DataError,
    DeviceError,
    Faults,
    HammeredStructure,
    Hammering,
    HitFlags,
    SimulatedSource,
    Structure,
    TapsEmulator,
    TapsSource,
    estimate_frf,
    read_hits,
    read_tap,
    write_hit,
)
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.new_folder import make_machine_folder
from lobewatch.tap.plots import plots_of
from lobewatch.tap.plug import Plug
from lobewatch.tap.session import TapSession, TapStopped
from lobewatch.tap.state import TapState, Word

RATE = 25600.0
Tapper = Callable[..., HammeredStructure]
Pair = tuple[Channel, Channel]
Watch = Callable[[TapState], None]


@pytest.fixture
def folder(tmp_path: Path) -> MachineFolder:
    make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    return MachineFolder(tmp_path / "m")


@pytest.fixture
def open_folder(folder: MachineFolder) -> MachineFolder:
    """A machine file that leaves trigger level and record length to trial hits."""
    text = folder.toml.read_text("utf-8")
    folder.toml.write_text(re.sub(r"^(record_s|trigger_n) .*\n", "", text, flags=re.MULTILINE), "utf-8")
    return MachineFolder(folder.path)


class Simulated(SimulatedSource):
    """A device without a cable; `unplugged` is asked before every block."""

    def __init__(
        self, signal: HammeredStructure, channels: Pair, seconds: float = 60.0, unplugged: Callable[[], bool] = bool
    ) -> None:
        super().__init__(signal, channels, RATE, round(seconds * RATE))
        self.info = {"model": "simulation"}
        self._unplugged = unplugged

    def blocks(self) -> Iterator[Block]:
        for block in super().blocks():
            if self._unplugged():
                raise DeviceError("the DAQ on /dev/x was unplugged; plug it in and repeat the command")
            yield block

    def close(self) -> None: ...


def session_of(
    folder: MachineFolder, open_device: Callable[[], Any], watch: Watch = lambda _: None, **options: Any
) -> TapSession:
    """A session whose every new state is handed to `watch`, through the clock that it asks after each."""
    about = Circumstances("m", datetime.now(UTC), "reference", machine_toml=folder.toml.read_text("utf-8"))
    made: list[TapSession] = []

    def clock() -> float:
        if made:
            watch(made[0].state)
        return time.monotonic()

    made.append(TapSession(folder, open_device, about, clock=clock, sleep=lambda _: None, **options))
    return made[0]


def runs(words: list[Word]) -> list[Word]:
    return [word for word, _ in groupby(words)]


def test_the_words_of_a_test_and_its_result(folder: MachineFolder, tapper: Tapper, channels: Pair) -> None:
    states: list[TapState] = []
    session = session_of(folder, lambda: Simulated(tapper(), channels), states.append)
    tap = session.run()
    assert tap.frf.n_averages == 10
    words = runs([state.word for state in states])
    assert words[0] is Word.CHECKING
    assert words[-1] is Word.DONE
    cycle = "".join({Word.TAP: "T", Word.WAIT: "W", Word.GOOD: "G"}.get(word, "") for word in words)
    assert re.fullmatch(r"W?T?(WG(W?T)?)+", cycle), cycle
    assert [state.revision for state in states] == sorted(state.revision for state in states)
    done = session.state
    assert (done.good, len(done.hits)) == (10, 10)
    assert [check.name for check in done.checks if not check.passed] == ["calibration"]
    assert done.outcome is not None
    assert done.outcome.light == "good"
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


def test_trial_hits_choose_what_is_open_and_do_not_count(
    open_folder: MachineFolder, tapper: Tapper, channels: Pair
) -> None:
    states: list[TapState] = []
    session = session_of(open_folder, lambda: Simulated(tapper(), channels), states.append)
    tap = session.run()
    reasons = [state.reason for state in states]
    assert any("Trial hit 1: " in reason for reason in reasons)
    chosen = next(reason for reason in reasons if reason.startswith("Trigger at"))
    assert re.match(r"Trigger at [12]\d N, record 0.25 s, \d\d time constants of the slowest mode\.$", chosen)
    assert next(state for state in states if state.verdict == "trial hit").good == 0
    assert (session.state.checks[-1].name, session.state.checks[-1].text) == ("trial hits", chosen.removesuffix("."))
    assert len(tap.hits) == 10


def test_a_refused_trial_hit_says_what_is_wrong_with_it(
    open_folder: MachineFolder, tapper: Tapper, channels: Pair
) -> None:
    states: list[TapState] = []
    double = Simulated(tapper(double_hits=1.0), channels, unplugged=lambda: session.state.word is Word.REFUSED)
    devices = iter((double, Simulated(tapper(), channels)))
    session = session_of(open_folder, lambda: next(devices), states.append)
    assert len(session.run().hits) == 10
    refused = next(state for state in states if state.word is Word.REFUSED)
    assert (refused.verdict, refused.reason) == ("double hit, trial hit", HitFlags.DOUBLE_HIT.cure)


def test_undo_takes_back_the_last_good_hits_one_by_one_and_the_last_one_too(
    folder: MachineFolder, tapper: Tapper, channels: Pair
) -> None:
    asked: set[int] = set()

    def watch(state: TapState) -> None:
        for good, times in ((3, 2), (10, 1)):
            if state.good == good and good not in asked:
                asked.add(good)
                for _ in range(times):
                    session.undo()

    session = session_of(folder, lambda: Simulated(tapper(), channels), watch)
    tap = session.run()
    undone = [i for i, flags in enumerate(tap.flags, 1) if flags is HitFlags.UNDONE]
    assert undone == [2, 3, 12]
    assert [hit.number for hit in session.state.hits if hit.undone] == undone
    assert len(tap.accepted) == 10
    assert np.array_equal(tap.frf.receptance, estimate_frf(tap.accepted).receptance)
    path = folder.path / "taps" / f"{tap.id}.h5"
    assert read_tap(path).flags == tap.flags
    assert len(read_hits(path)) == 10


def test_a_first_hit_at_another_spot_is_found_out_by_those_after_it(
    folder: MachineFolder, tapper: Tapper, structure: Structure, channels: Pair
) -> None:
    spot = replace(structure, stiffness=structure.stiffness * np.array([1.0, 1.5, 1.0]))
    how = Hammering(double_hits=0.0, overloads=0.0)
    astray = HammeredStructure(spot, RATE, np.random.default_rng(3), how)
    devices = iter(
        (Simulated(astray, channels, unplugged=lambda: session.state.good == 1), Simulated(tapper(), channels))
    )
    states: list[TapState] = []
    session = session_of(folder, lambda: next(devices), states.append)
    tap = session.run()
    assert tap.flags == (HitFlags.INCONSISTENT, *[HitFlags.OK] * 10)
    told = next(state for state in states if state.verdict == "inconsistent")
    assert (told.good, len(told.hits), told.word) == (3, 4, Word.WAIT)
    assert re.match(r"Hit 1 does not fit the others and counts no more\. FRF \d+% away from the mean of 3", told.reason)
    assert np.array_equal(tap.frf.receptance, estimate_frf(tap.hits[1:]).receptance)


@pytest.mark.parametrize(
    ("failure", "told"),
    [
        (OSError(errno.ENOSPC, "No space left on device", "m/spool/x/0003.h5"), DataError),
        (MemoryError("no room"), RuntimeError),
    ],
)
def test_a_full_disk_or_a_mistake_of_ours_is_told_and_costs_no_hit(
    failure: Exception,
    told: type[Exception],
    folder: MachineFolder,
    tapper: Tapper,
    channels: Pair,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def failing(*arguments: Any) -> None:
        if session.state.good == 3:
            raise failure
        write_hit(*arguments)

    monkeypatch.setattr("lobewatch.tap.in_progress.write_hit", failing)
    session = session_of(folder, lambda: Simulated(tapper(), channels))
    with pytest.raises(told, match="the hits so far are kept: the same command goes on with them") as raised:
        session.run()
    assert session.state.word is Word.FAILED
    assert session.state.reason == str(raised.value)
    assert "Errno" not in session.state.reason
    monkeypatch.undo()
    session = session_of(folder, lambda: Simulated(tapper(2), channels))
    assert len(session.run().hits) == 10
    assert sum(hit.earlier for hit in session.state.hits) == 3


def test_good_is_not_said_of_a_hit_taken_back(folder: MachineFolder, tapper: Tapper, channels: Pair) -> None:
    def watch(state: TapState) -> None:
        states.append(state)
        if state.word is Word.GOOD and state.good == len(state.hits) == 3:
            session.undo()

    states: list[TapState] = []
    session = session_of(folder, lambda: Simulated(tapper(), channels), watch)
    session.run()
    undone = [state for state in states if state.verdict == "undone"]
    assert undone[0].reason == "Hit 3 was taken back."
    assert {state.word for state in undone} <= {Word.WAIT, Word.TAP}


def test_a_stopped_test_is_gone_on_with_by_the_set_up_it_began_with(
    open_folder: MachineFolder, tapper: Tapper, channels: Pair
) -> None:
    def stop(state: TapState) -> None:
        if state.good == 4:
            session.stop()

    session = session_of(open_folder, lambda: Simulated(tapper(), channels), stop)
    with pytest.raises(TapStopped, match="stopped with 4 good hits; the same command goes on with them"):
        session.run()
    (setup,) = open_folder.spool.glob("*/setup.json")
    level = json.loads(setup.read_text())["level"]
    assert 10 < level < 40
    states: list[TapState] = []
    again = session_of(open_folder, lambda: Simulated(tapper(2), channels), states.append)
    tap = again.run()
    assert not any("Trial" in state.reason for state in states)
    assert next(check for check in again.state.checks if check.name == "force noise").text.endswith(f"at {level:g} N")
    assert re.match(r"going on with the test begun .*: 4 of 10 good hits are there", again.state.resumed)
    assert [hit.earlier for hit in again.state.hits] == [True] * 4 + [False] * 6
    assert len(tap.hits) == 10
    assert not list(open_folder.spool.iterdir())


UNPLUGGED: dict[str, Callable[[TapState], bool]] = {
    "checking": lambda state: state.word is Word.CHECKING and "hammer away" in state.reason,
    "trial": lambda state: state.word is Word.TAP and state.reason.startswith("Trial hit 2"),
    "armed": lambda state: state.word is Word.TAP and state.good == 4,
    "recording": lambda state: state.word is Word.WAIT and state.good == 4,
    "between hits": lambda state: state.word is Word.GOOD and state.good == 4 and state.verdict == "good",
}


@pytest.mark.parametrize("where", UNPLUGGED)
def test_an_unplugged_device_is_waited_for_and_the_test_goes_on_at_the_same_hit(
    where: str, open_folder: MachineFolder, tapper: Tapper, channels: Pair
) -> None:
    states: list[TapState] = []
    opened = count()
    pulled: list[int] = []

    def unplugged() -> bool:
        if not pulled and UNPLUGGED[where](session.state):
            pulled.append(session.state.good)
        return bool(pulled) and next(opened) == 0

    def open_device() -> Simulated:
        if pulled and len(pulled) < 4:
            pulled.append(0)
            raise DeviceError("port /dev/x cannot be opened (No such file or directory); check the cable")
        return Simulated(tapper(len(pulled) + 1, interval_range=(1.2, 1.4)), channels, unplugged=unplugged)

    session = session_of(open_folder, open_device, states.append)
    tap = session.run()
    away = [state for state in states if state.word is Word.NO_DEVICE]
    assert {state.good for state in away} == {pulled[0]}
    reasons = list(dict.fromkeys(state.reason for state in away))
    assert [reason.partition(";")[0] for reason in reasons] == [
        "the DAQ on /dev/x was unplugged",
        "port /dev/x cannot be opened (No such file or directory)",
    ]
    assert all(reason.endswith("the test goes on at this hit") for reason in reasons)
    assert len(tap.accepted) == len(tap.hits) == 10


def test_a_cable_pulled_from_a_real_port(folder: MachineFolder, tapper: Tapper, channels: Pair) -> None:
    with (
        TapsEmulator(tapper(1), channels, RATE, realtime=False, faults=Faults(unplug_after=100_000)) as first,
        TapsEmulator(tapper(2), channels, RATE, realtime=False) as second,
    ):
        ports = iter((first.port, second.port))
        states: list[TapState] = []
        session = session_of(folder, lambda: TapsSource(next(ports)), states.append)
        tap = session.run()
    assert Word.NO_DEVICE in {state.word for state in states}
    assert len(tap.accepted) == 10
    assert not any(hit.lost_scans for hit in tap.hits)


def test_a_device_that_comes_back_elsewhere_is_found_and_a_stranger_at_its_port_is_left_alone(
    folder: MachineFolder, tapper: Tapper, channels: Pair, monkeypatch: pytest.MonkeyPatch
) -> None:
    opened: list[str] = []

    def open_taps(port: str, sample_rate: float | None) -> TapsSource:
        opened.append(port)
        return TapsSource(port, sample_rate)

    with (
        TapsEmulator(tapper(1), channels, RATE, realtime=False, faults=Faults(unplug_after=100_000)) as first,
        TapsEmulator(tapper(2), channels, RATE, realtime=False) as second,
    ):
        ports = [SimpleNamespace(device=first.port, vid=0x16C0, serial_number="5C2B")]

        def plug(state: TapState) -> None:
            if state.word is Word.NO_DEVICE:
                ports[0] = SimpleNamespace(device=first.port, vid=0x16C0, serial_number="a stranger")
            if "serial number 5C2B is not plugged in; plug it in: the test goes on" in state.reason:
                ports.append(SimpleNamespace(device=second.port, vid=0x16C0, serial_number="5C2B"))

        monkeypatch.setattr("serial.tools.list_ports.comports", lambda **_: ports)
        monkeypatch.setattr("lobewatch.tap.plug.TapsSource", open_taps)
        tap = session_of(folder, Plug(folder.machine.daq, first.port).open, plug).run()
    assert opened == [first.port, second.port]
    assert len(tap.accepted) == 10


def test_a_taken_port_is_told_at_the_start(folder: MachineFolder, tapper: Tapper, channels: Pair) -> None:
    with TapsEmulator(tapper(), channels, RATE, realtime=False) as device, TapsSource(device.port):
        session = session_of(folder, lambda: TapsSource(device.port))
        with pytest.raises(DeviceError, match="another program uses it: close that program"):
            session.run()
    assert session.state.word is Word.FAILED
    assert "another program uses it" in session.state.reason


def test_a_fault_that_the_device_reports_is_told_and_its_end_too(
    folder: MachineFolder, tapper: Tapper, channels: Pair
) -> None:
    class Faulty(Simulated):
        @property
        def fault(self) -> str:
            return "acceleration: cable open" if 2 <= session.state.good < 4 else ""

    states: list[TapState] = []
    session = session_of(folder, lambda: Faulty(tapper(), channels), states.append)
    session.run()
    told = [state.reason for state in states]
    assert told.index("acceleration: cable open") < told.index("The sensor is connected again.")


def test_samples_that_end_are_told(folder: MachineFolder, tapper: Tapper, channels: Pair) -> None:
    session = session_of(folder, lambda: Simulated(tapper(), channels, seconds=2.5), guided=False)
    with pytest.raises(DataError, match=r"the samples have ended with [45] of 10 good hits"):
        session.run()


def test_samples_that_end_with_the_last_hit_are_enough(folder: MachineFolder, tapper: Tapper, channels: Pair) -> None:
    """As those of a recorded tap test do: the time to take the last hit back is over with them."""

    class Ending(Simulated):
        def blocks(self) -> Iterator[Block]:
            return takewhile(lambda _: session.state.good < 10, super().blocks())

    session = session_of(folder, lambda: Ending(tapper(), channels))
    assert session.run().frf.n_averages == 10


def test_no_scan_is_lost_to_a_slow_disk_and_slow_mathematics(
    folder: MachineFolder, tapper: Tapper, channels: Pair, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder.toml.write_text(folder.toml.read_text("utf-8").replace("hits = 10", "hits = 3"), "utf-8")
    slowed = []

    def slow(function: Callable[..., Any]) -> Callable[..., Any]:
        def late(*arguments: Any) -> Any:
            slowed.append(function.__name__)
            time.sleep(0.5)
            return function(*arguments)

        return late

    monkeypatch.setattr("lobewatch.tap.in_progress.write_hit", slow(write_hit))
    monkeypatch.setattr("lobewatch.tap.session.plots_of", slow(plots_of))
    lost: list[int] = []

    class Counting(TapsSource):
        def blocks(self) -> Iterator[Block]:
            for block in super().blocks():
                lost.append(block.lost_before)
                yield block

    with TapsEmulator(tapper(), channels, RATE, realtime=True) as device:
        tap = session_of(MachineFolder(folder.path), lambda: Counting(device.port)).run()
    assert slowed.count("write_hit") == slowed.count("plots_of") == len(tap.hits) >= 3
    assert sum(lost) == 0
    assert len(lost) > 3 * 0.4 * RATE / 512


def test_a_verdict_does_not_wait_for_the_disk_and_counts_once_it_is_there(
    folder: MachineFolder, tapper: Tapper, channels: Pair, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown: list[tuple[Word, str, int]] = []

    def keep(*arguments: Any) -> None:
        shown.append((session.state.word, session.state.verdict, session.state.good))
        write_hit(*arguments)

    monkeypatch.setattr("lobewatch.tap.in_progress.write_hit", keep)
    session = session_of(folder, lambda: Simulated(tapper(), channels))
    session.run()
    assert shown == [(Word.GOOD, "good", good) for good in range(10)]


def test_there_is_no_measurement_before_the_end(folder: MachineFolder, tapper: Tapper, channels: Pair) -> None:
    session = session_of(folder, lambda: Simulated(tapper(), channels))
    with pytest.raises(ValueError, match="not finished"):
        _ = session.measurement


def test_a_device_with_another_sensor_does_not_go_on_with_the_test(
    folder: MachineFolder, tapper: Tapper, channels: Pair
) -> None:
    other = (channels[0], Channel("acceleration", 2 * channels[1].sensitivity, 5.0))
    devices = iter(
        (Simulated(tapper(), channels, unplugged=lambda: session.state.good == 2), Simulated(tapper(2), other))
    )
    session = session_of(folder, lambda: next(devices))
    with pytest.raises(ValueError, match="another length, sample rate or sensor; begin anew with --new"):
        session.run()


def test_a_cable_pulled_after_the_last_hit_does_not_keep_the_result_back(
    folder: MachineFolder, tapper: Tapper, channels: Pair
) -> None:
    devices = iter([Simulated(tapper(), channels, unplugged=lambda: session.state.good == 10)])
    session = session_of(folder, lambda: next(devices))
    assert len(session.run().accepted) == 10
    assert session.state.word is Word.DONE
