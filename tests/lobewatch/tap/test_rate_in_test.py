"""A DAQ whose sample rate has changed since it was measured: the test is refused, its hits are kept and corrected."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from typing import Any

import numpy as np
import pytest

from acquisition import (
    Block,
    Circumstances,
    DataError,
    DeviceError,
    DeviceIdentity,
    HammeredStructure,
    Hammering,
    MeasuredRate,
)
from acquisition.sensors.stream_rate import StreamRate
from lobewatch.machine.daq_rates import apply_measured_rate, find_stored_rate, replace_stored_rate
from lobewatch.machine.folder import MachineFolder
from lobewatch.tap.emulated_spindle import EMULATED_CHANNELS, build_structure
from lobewatch.tap.tap_in_progress import begin_tap
from tests.lobewatch.tap.conftest import RATE, Simulated


class Board(Simulated):
    """Board with a clock of its own. `arrived` is the time at which its newest block arrived."""

    follows_clock = True
    identity = DeviceIdentity("board", "7")

    def __init__(self, folder: MachineFolder, error: float) -> None:
        spindle, self.true_rate, self.arrived = folder.machine.spindle, (1 + error) * RATE, 0.0
        assert spindle is not None
        structure = build_structure(spindle.build(), spindle.damping_ratio)
        self.frequency = float(structure.frequency[0])
        hitting = Hammering(double_hits=0.0, overloads=0.0)
        hammered = HammeredStructure(structure, self.true_rate, np.random.default_rng(1), hitting)
        super().__init__(hammered, EMULATED_CHANNELS)

    def blocks(self) -> Iterator[Block]:
        for block in super().blocks():
            self.arrived += block.codes.shape[1] / self.true_rate
            yield block


@pytest.fixture
def tapped(
    folder: MachineFolder, session_of: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> Callable[[float], Any]:
    """Return a function that taps with a board whose clock is off by a share, and returns its session."""
    board = Board(folder, 0.0)
    apply_measured_rate(folder, board, MeasuredRate(RATE, 1.0, 128_000, 5.0))

    def tap(error: float) -> Any:
        board = Board(folder, error)
        monkeypatch.setattr(
            "lobewatch.tap.device_connection.StreamRate", partial(StreamRate, clock=lambda: board.arrived)
        )
        session = session_of(MachineFolder(folder.path), lambda: board, guided=False)
        session.run()
        return session

    return tap


def accept_measured_rate(folder: MachineFolder) -> None:
    text = folder.toml.read_text("utf-8")
    folder.toml.write_text(text.replace("[daq]", "[daq]\naccept_measured_rate = true"), "utf-8")


def test_a_wrong_rate_refuses_the_test_and_its_hits_are_corrected_later(
    tapped: Callable[[float], Any], folder: MachineFolder
) -> None:
    error = -0.05
    with pytest.raises(DataError, match="measure_rate"):
        tapped(error)
    assert folder.taps() == []
    (spool,) = folder.spool.iterdir()
    kept = len(list(spool.glob("[0-9]*.h5")))
    assert 0 < kept <= 10
    stored = find_stored_rate(folder, Board(folder, error))
    assert stored is not None
    assert stored.rate == pytest.approx((1 + error) * RATE, rel=5e-4)
    with pytest.raises(DeviceError, match="accept_measured_rate"):
        tapped(error)  # the old rate is not used again
    accept_measured_rate(folder)
    session = tapped(error)
    (entry,) = folder.taps()
    hits = folder.read(entry).hits
    assert {hit.sample_rate for hit in hits} == {stored.rate}
    assert sum(hit.earlier for hit in session.state.hits) == kept
    assert session.remarks == ()
    (check,) = [check for check in session.state.checks if check.name == "sample rate"]
    assert check.passed
    truth = Board(folder, error).frequency
    assert session.measurement.followed.frequency == pytest.approx(truth, rel=1e-3)


@pytest.mark.parametrize(("change", "n_kept"), [pytest.param(2e-4, 1, marks=pytest.mark.long), (5e-3, 0)])
def test_kept_hits_get_a_rate_that_was_measured_again(
    tapped: Callable[[float], Any], folder: MachineFolder, change: float, n_kept: int
) -> None:
    error = -0.05
    with pytest.raises(DataError):
        tapped(error)
    stored = find_stored_rate(folder, Board(folder, error))
    assert stored is not None
    again = replace(stored, rate=stored.rate * (1 + change))
    replace_stored_rate(folder, Board(folder, error), again)
    accept_measured_rate(folder)
    if not n_kept:
        with pytest.raises(ValueError, match="resume"):
            tapped(error)
        return
    session = tapped(error)
    (entry,) = folder.taps()
    assert {hit.sample_rate for hit in folder.read(entry).hits} == {again.rate}
    assert sum(hit.earlier for hit in session.state.hits) >= n_kept
    assert session.measurement.followed.frequency == pytest.approx(Board(folder, error).frequency, rel=1e-3)


def test_hits_of_an_unknown_rate_are_not_resumed(tapped: Callable[[float], Any], folder: MachineFolder) -> None:
    with pytest.raises(DataError):
        tapped(-0.05)
    (spool,) = folder.spool.iterdir()
    fields = json.loads((spool / "rate.json").read_text("utf-8"))
    (spool / "rate.json").write_text(json.dumps(fields | {"rate": RATE}), "utf-8")  # altered
    about = Circumstances("m", datetime.now(UTC), "reference")
    accept_measured_rate(folder)
    tap = begin_tap(MachineFolder(folder.path), about)
    assert tap.hits == []
    assert any(spool.name in text for text in tap.not_resumed)


@pytest.mark.parametrize(
    ("error", "is_refused"), [(0.0036, True), pytest.param(-0.0036, True, marks=pytest.mark.long), (0.001, False)]
)
def test_a_short_test_reads_on_until_a_small_error_is_known(
    tapped: Callable[[float], Any], folder: MachineFolder, error: float, is_refused: bool
) -> None:
    if is_refused:
        with pytest.raises(DataError, match="measure_rate"):
            tapped(error)
    else:
        assert tapped(error).remarks == ()
    assert len(folder.taps()) == (not is_refused)
