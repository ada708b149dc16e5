"""Button of a device takes the last good hit back, through the bytes of a real port."""

from __future__ import annotations

import re
import time
from collections import deque
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import (
    Channel,
    Event,
    EventKind,
    HammeredStructure,
    HitFlags,
    SimulatedSource,
    TapsEmulator,
    TapsSource,
    TapTest,
)
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.device_connection import DeviceConnection
from lobewatch.tap.hit_loop import TapStopped
from lobewatch.tap.session import TapSession
from lobewatch.tap.state import TapState

RATE = 25600.0
Tapper = Callable[..., HammeredStructure]
Pair = tuple[Channel, Channel]
OpenSession = Callable[..., TapSession]
PRESS, RELEASE = Event(EventKind.BUTTON), Event(EventKind.BUTTON, begins=False)


class Played:
    """Signal with events at the device after certain scans."""

    def __init__(self, signal: HammeredStructure, events: dict[float, Event]) -> None:
        self._signal = signal
        self._due = deque(sorted((time * RATE, event) for time, event in events.items()))
        self.send: Callable[[Event], None] = lambda _: None

    def __call__(self, start: int, count: int) -> NDArray[np.float64]:
        while self._due and self._due[0][0] < start + count:
            self.send(self._due.popleft()[1])
        return np.asarray(self._signal(start, count))


def test_the_button_undoes_the_last_good_hit_once_a_press(
    folder: MachineFolder, tapper: Tapper, channels: Pair, session_of: OpenSession
) -> None:
    pressed = {2.0: PRESS, 2.1: RELEASE, 2.2: PRESS, 3.5: PRESS, 3.6: RELEASE, 4.0: Event(7), 4.2: PRESS}
    signal = Played(tapper(), pressed)
    states: list[TapState] = []
    with TapsEmulator(signal, channels, RATE, realtime=False) as device:
        signal.send = device.send_event
        session = session_of(folder, lambda: TapsSource(device.port), states.append)
        tap = session.run()
    undone = [i for i, flags in enumerate(tap.flags, 1) if flags is HitFlags.UNDONE]
    assert len(undone) == 3
    assert len(tap.accepted) == 10
    said = list(dict.fromkeys(state.reason for state in states if "button" in state.reason))
    assert [re.findall(r"\d+", text) for text in said] == [[str(number)] for number in undone]
    first = next(i for i, state in enumerate(states) if state.reason == said[0])
    assert states[first].good == states[first - 1].good - 1


def test_what_the_button_did_before_the_stream_counts_for_nothing(
    folder: MachineFolder, tapper: Tapper, channels: Pair, session_of: OpenSession
) -> None:
    def stop(state: TapState) -> None:
        if state.good == 4:
            session.stop()

    with TapsEmulator(tapper(), channels, RATE, realtime=False) as device:
        session: TapSession = session_of(folder, lambda: TapsSource(device.port), stop)
        with pytest.raises(TapStopped):
            session.run()

    def pressed_when_connected() -> TapsSource:
        source = TapsSource(device.port)
        device.send_event(PRESS)
        while device._pending_events:  # noqa: SLF001  (it is told before the next command is read)
            time.sleep(0.01)
        return source

    with TapsEmulator(tapper(2), channels, RATE, realtime=False) as device:
        tap: TapTest = session_of(folder, pressed_when_connected).run()
    assert HitFlags.UNDONE not in tap.flags
    assert len(tap.hits) == 10


@pytest.mark.parametrize(
    ("scans", "presses"),
    [((0,), 1), ((0, 100), 1), ((0, 200, 400), 1), ((0, 300), 2), ((500, 900, 100), 3), ((7, 7), 1)],
)
def test_presses_are_distinguished_from_bouncing_by_the_clock_of_the_device(
    tapper: Tapper, channels: Pair, scans: tuple[int, ...], presses: int
) -> None:
    device = SimulatedSource(tapper(), channels, 1000.0, n_scans=0)
    device.events.extend(Event(EventKind.BUTTON, scan=scan) for scan in scans)
    assert DeviceConnection(device).count_presses() == presses
    assert not device.events


def test_a_button_let_go_is_not_pressed_and_bounces_then_too(tapper: Tapper, channels: Pair) -> None:
    device = SimulatedSource(tapper(), channels, 1000.0, n_scans=0)
    connection = DeviceConnection(device)

    def count(scan: int, begins: bool) -> int:
        device.events.append(Event(EventKind.BUTTON, begins, scan=scan))
        return connection.count_presses()

    moves = ((0, True), (2000, False), (2001, True), (2002, False), (2400, True))
    assert [count(*move) for move in moves] == [1, 0, 0, 0, 1]
