"""Device of a live tap test: unplugged at any step, found again, reported faults, samples that end."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import count
from types import SimpleNamespace
from typing import Any

import pytest

from acquisition import Channel, DataError, DeviceError, HammeredStructure, TapsEmulator, TapsFaults, TapsSource
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.device_connection import DeviceOpener
from lobewatch.tap.session import TapSession
from lobewatch.tap.state import TapState, TapStep

RATE = 25600.0
Tapper = Callable[..., HammeredStructure]
Pair = tuple[Channel, Channel]
Simulate = Callable[..., Any]
"""Makes the device of conftest.py."""
OpenSession = Callable[..., TapSession]


UNPLUGGED: dict[str, Callable[[TapState], bool]] = {
    "checking": lambda state: state.word is TapStep.CHECKING and "hammer" in state.reason,
    "trial": lambda state: state.word is TapStep.TAP and state.reason.startswith("Trial hit 2"),
    "armed": lambda state: state.word is TapStep.TAP and state.good == 4,
    "recording": lambda state: state.word is TapStep.WAIT and state.good == 4,
    "between hits": lambda state: state.word is TapStep.GOOD and state.good == 4 and state.verdict == "good",
}


@pytest.mark.parametrize("where", UNPLUGGED)
def test_an_unplugged_device_is_waited_for_and_the_test_goes_on_at_the_same_hit(
    where: str, open_folder: MachineFolder, tapper: Tapper, channels: Pair, simulated: Simulate, session_of: OpenSession
) -> None:
    states: list[TapState] = []
    opened = count()
    pulled: list[int] = []

    def unplugged() -> bool:
        if not pulled and UNPLUGGED[where](session.state):
            pulled.append(session.state.good)
        return bool(pulled) and next(opened) == 0

    def open_device() -> Any:
        if pulled and len(pulled) < 4:
            pulled.append(0)
            raise DeviceError("port /dev/x cannot be opened (No such file or directory)", "Check the cable")
        return simulated(tapper(len(pulled) + 1, interval_range=(1.2, 1.4)), channels, unplugged=unplugged)

    session = session_of(open_folder, open_device, states.append)
    tap = session.run()
    away = [state for state in states if state.word is TapStep.NO_DEVICE]
    assert {state.good for state in away} == {pulled[0]}
    reasons = list(dict.fromkeys(state.reason for state in away))
    assert len(reasons) == 2
    assert all("/dev/x" in reason for reason in reasons)
    assert ["No such file or directory" in reason for reason in reasons] == [False, True]
    assert len(tap.accepted) == len(tap.hits) == 10


def test_a_cable_pulled_from_a_real_port(
    folder: MachineFolder, tapper: Tapper, channels: Pair, session_of: OpenSession
) -> None:
    with (
        TapsEmulator(tapper(1), channels, RATE, realtime=False, faults=TapsFaults(unplug_after=100_000)) as first,
        TapsEmulator(tapper(2), channels, RATE, realtime=False) as second,
    ):
        ports = iter((first.port, second.port))
        states: list[TapState] = []
        session = session_of(folder, lambda: TapsSource(next(ports)), states.append)
        tap = session.run()
    assert TapStep.NO_DEVICE in {state.word for state in states}
    assert len(tap.accepted) == 10
    assert not any(hit.lost_scans for hit in tap.hits)


def test_a_cable_pulled_after_the_last_hit_does_not_keep_the_result_back(
    folder: MachineFolder, tapper: Tapper, channels: Pair, simulated: Simulate, session_of: OpenSession
) -> None:
    devices = iter([simulated(tapper(), channels, unplugged=lambda: session.state.good == 10)])
    session: TapSession = session_of(folder, lambda: next(devices))
    assert len(session.run().accepted) == 10
    assert session.state.word is TapStep.DONE


def test_a_device_that_comes_back_elsewhere_is_found_and_a_stranger_at_its_port_is_left_alone(
    folder: MachineFolder, tapper: Tapper, channels: Pair, monkeypatch: pytest.MonkeyPatch, session_of: OpenSession
) -> None:
    opened: list[str] = []

    def open_taps(port: str, sample_rate: float | None) -> TapsSource:
        opened.append(port)
        return TapsSource(port, sample_rate)

    with (
        TapsEmulator(tapper(1), channels, RATE, realtime=False, faults=TapsFaults(unplug_after=100_000)) as first,
        TapsEmulator(tapper(2), channels, RATE, realtime=False) as second,
    ):
        ports = [SimpleNamespace(device=first.port, vid=0x16C0, serial_number="5C2B")]

        def plug(state: TapState) -> None:
            if state.word is TapStep.NO_DEVICE:
                ports[0] = SimpleNamespace(device=first.port, vid=0x16C0, serial_number="a stranger")
            if "5C2B" in state.reason:
                ports.append(SimpleNamespace(device=second.port, vid=0x16C0, serial_number="5C2B"))

        monkeypatch.setattr("serial.tools.list_ports.comports", lambda **_: ports)
        monkeypatch.setattr("acquisition.taps.source.TapsSource", open_taps)
        tap = session_of(folder, DeviceOpener(folder.machine.daq, first.port).open, plug).run()
    assert opened == [first.port, second.port]
    assert len(tap.accepted) == 10


def test_a_device_with_another_sensor_does_not_go_on_with_the_test(
    folder: MachineFolder, tapper: Tapper, channels: Pair, simulated: Simulate, session_of: OpenSession
) -> None:
    other = (channels[0], Channel("acceleration", 2 * channels[1].sensitivity, 5.0))
    devices = iter(
        (simulated(tapper(), channels, unplugged=lambda: session.state.good == 2), simulated(tapper(2), other))
    )
    session: TapSession = session_of(folder, lambda: next(devices))
    with pytest.raises(ValueError, match=r"plan_session\.resume=False"):
        session.run()


def test_a_taken_port_is_reported_at_the_start(
    folder: MachineFolder, tapper: Tapper, channels: Pair, session_of: OpenSession
) -> None:
    with TapsEmulator(tapper(), channels, RATE, realtime=False) as device, TapsSource(device.port):
        session = session_of(folder, lambda: TapsSource(device.port))
        with pytest.raises(DeviceError, match=re.escape(device.port)):
            session.run()
    assert session.state.word is TapStep.FAILED
    assert device.port in session.state.reason


def test_a_fault_that_the_device_reports_is_reported_and_its_end_too(
    folder: MachineFolder, tapper: Tapper, channels: Pair, simulated: Simulate, session_of: OpenSession
) -> None:
    def fault() -> str:
        return "acceleration: cable open" if 2 <= session.state.good < 4 else ""

    states: list[TapState] = []
    session = session_of(folder, lambda: simulated(tapper(), channels, fault=fault), states.append)
    session.run()
    told = [state.reason for state in states]
    assert told.index("acceleration: cable open") < told.index("The sensor is connected again.")


def test_samples_that_end_are_reported(
    folder: MachineFolder, tapper: Tapper, channels: Pair, simulated: Simulate, session_of: OpenSession
) -> None:
    session = session_of(folder, lambda: simulated(tapper(), channels, seconds=2.5), guided=False)
    with pytest.raises(DataError, match=r"[45] of 10"):
        session.run()


def test_samples_that_end_with_the_last_hit_are_enough(
    folder: MachineFolder, tapper: Tapper, channels: Pair, simulated: Simulate, session_of: OpenSession
) -> None:
    """Check that samples which end with the last hit leave no time to take it back, as in a recorded test."""
    session: TapSession = session_of(
        folder, lambda: simulated(tapper(), channels, ended=lambda: session.state.good == 10)
    )
    assert session.run().required_frf.n_averages == 10
