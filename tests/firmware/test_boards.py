"""Boards with the C core against the source of TAPS/1: samples, losses, overload, button, whole tap tests."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from itertools import islice, pairwise
from operator import or_
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Block, DeviceError, EventKind, Hit, HitFlags, TapsFaults, TapsSource, TapTest
from lobewatch.machine.folder import MachineFolder
from lobewatch.machine.folder_files import make_machine_folder
from lobewatch.tap.session import TapSession, plan_session
from lobewatch.tap.state import TapState

Codes = NDArray[np.int32]
FRAME = 256
"""Scans in a DATA frame of these boards."""
RING = 1024
"""Scans that they keep for a host that is late."""
HAPPENING = [(3.0, "B"), (3.1, "b"), (3.2, "O"), (3.8, "o"), *((4.0 + 0.16 * i, "L") for i in range(4))]
"""At a board that is tapped: seconds since power came on, and what happens."""
TRUTH = 1722.0
"""Frequency of the mode that is followed (Hz)."""


def assert_right(blocks: list[Block], codes: Codes) -> None:
    """Check that every sample has its index and each gap is reported before the next block."""
    for block in blocks:
        places = np.arange(block.first_scan, block.first_scan + block.codes.shape[1]) % codes.shape[1]
        assert np.array_equal(block.codes, codes[:, places])
    assert all(b.first_scan == a.first_scan + a.codes.shape[1] + b.lost_before for a, b in pairwise(blocks))


def test_scans_arrive_unchanged_and_complete(board: Any, codes: Codes) -> None:
    with TapsSource(board.port) as source:
        assert (source.identity.firmware, source.sample_rate, source.follows_clock) == ("1.0", 25600.0, False)
        assert [channel.quantity for channel in source.channels] == ["force", "acceleration"]
        source.start()
        blocks = list(islice(source.blocks(), 300))
        assert [block.first_scan for block in blocks] == [FRAME * i for i in range(300)]
        assert_right(blocks, codes)
        assert (source.lost_scans, source.dropped_frames) == (0, 0)
        source.stop()
        source.start()
        assert next(source.blocks()).first_scan == 0


@pytest.mark.parametrize(
    ("fault", "lost_each", "is_damaged"),
    [
        (TapsFaults(drop_every=7), 1, False),
        (TapsFaults(corrupt_every=7), 1, True),
        (TapsFaults(noise_every=7), 1, True),
        (TapsFaults(cut_every=7), 2, True),
        (TapsFaults(duplicate_every=7), 0, True),
    ],
    ids=["dropped", "wrong CRC", "noise", "cut", "doubled"],
)
def test_frames_lost_on_the_way_are_counted_exactly(
    board: Any, codes: Codes, harmful_cable: Any, fault: TapsFaults, lost_each: int, is_damaged: bool
) -> None:
    with harmful_cable(board.port, fault) as cable, TapsSource(cable.port) as source:
        source.start()
        blocks = list(islice(source.blocks(), 60))
        assert_right(blocks, codes)
        end = blocks[-1].first_scan
        lost = FRAME * lost_each * sum((at + lost_each - 1) * FRAME <= end for at in range(7, 100, 7))
        assert sum(block.lost_before for block in blocks) == lost
        assert (source.dropped_frames > 0) == is_damaged


@pytest.mark.parametrize("events", [[(9000, "L")]])
def test_a_board_whose_host_is_late_tells_what_it_lost(board: Any, codes: Codes) -> None:
    with TapsSource(board.port) as source:
        source.start()
        blocks = list(islice(source.blocks(), 400))
        assert_right(blocks, codes)
        gaps = [(block.first_scan, block.lost_before) for block in blocks if block.lost_before]
        assert len(gaps) == 1
        assert 9000 + 2 * RING < gaps[0][0] < 9000 + 4 * RING
        assert RING < gaps[0][1] < 3 * RING
        assert source.dropped_frames == 0
        assert source.status is not None
        assert (source.status.overruns, source.status.buffer_peak_percent) == (1, 100)
        waiting = source.status.samples_taken - source.status.samples_sent - source.lost_scans
        assert 0 <= waiting < RING


@pytest.mark.parametrize("events", [[(2000, "O"), (2001, "o"), (5000, "B"), (7000, "b")]])
def test_overload_and_button_are_reported_with_their_scan(board: Any) -> None:
    with TapsSource(board.port) as source:
        source.start()
        blocks = list(islice(source.blocks(), 60))
        assert [i for i, block in enumerate(blocks) if block.overload == 1] == [2000 // FRAME]
        down, up = source.events
    assert [(event.kind, event.begins, event.channel) for event in (down, up)] == [
        (EventKind.BUTTON, True, None),
        (EventKind.BUTTON, False, None),
    ]
    assert 5000 <= down.scan < 5000 + RING
    assert 7000 <= up.scan < 7000 + RING


def test_a_board_without_power_is_missed_at_once(board: Any) -> None:
    with TapsSource(board.port) as source:
        source.start()
        next(source.blocks())
        board.unplug()
        with pytest.raises(DeviceError, match="unplugged"):
            list(source.blocks())
        board.replug()
    with TapsSource(board.port) as source:
        source.start()
        assert next(source.blocks()).first_scan == 0


@pytest.fixture
def folder(tmp_path: Path) -> MachineFolder:
    make_machine_folder(tmp_path / "m", "surrogate_machine.toml")
    return MachineFolder(tmp_path / "m")


def watched(session: TapSession, watch: Callable[[TapState], None]) -> TapTest:
    """Run a session and show each of its states."""
    session.wakes.add(lambda: watch(session.state))
    return session.run()


def test_a_whole_tap_test_over_a_cable_with_every_fault(
    board: Any, codes: Codes, harmful_cable: Any, folder: MachineFolder
) -> None:
    faults = TapsFaults(drop_every=197, corrupt_every=189, duplicate_every=183, cut_every=179, noise_every=173)
    with harmful_cable(board.port, faults) as cable:
        session = plan_session(folder, port=cable.port)
        tap = session.run()
    assert_sound(session, tap, codes)
    assert any(HitFlags.LOST_SCANS in flags for flags in tap.flags)


@pytest.mark.parametrize("events", [[(round(25600 * second), letter) for second, letter in HAPPENING]])
def test_a_whole_tap_test_with_loss_overload_button_and_a_lost_board(
    board: Any, codes: Codes, folder: MachineFolder
) -> None:
    session = plan_session(folder, port=board.port)
    is_lost: list[bool] = []

    def watch(state: TapState) -> None:
        if len(state.hits) == 9 and not is_lost:
            is_lost.append(True)
            board.unplug()
            board.replug()

    tap = watched(session, watch)
    assert_sound(session, tap, codes)
    assert HitFlags.UNDONE | HitFlags.OVERLOAD_FORCE | HitFlags.LOST_SCANS in reduce(or_, tap.flags)
    assert is_lost


def assert_sound(session: TapSession, tap: TapTest, codes: Codes) -> None:
    """Ten good hits, every one of them as it was in the table, and the mode that is behind them."""
    played = np.concatenate([codes, codes[:, :12_800]], axis=1).T.astype("<i4").tobytes()
    assert len(tap.accepted) == 10
    assert all(codes_of(hit) in played for hit in tap.accepted)
    mode = min(session.measurement.modes, key=lambda mode: abs(mode.frequency - TRUTH))
    assert mode.frequency == pytest.approx(TRUTH, abs=0.2)


def codes_of(hit: Hit) -> bytes:
    """Return the bytes of the converter codes."""
    assert hit.codes is not None
    return hit.codes.T.astype("<i4").tobytes()
