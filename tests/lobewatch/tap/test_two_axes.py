"""Hammer and a sensor with two axes: the same hits give a tap in x and a cross tap, through the bytes of a device."""

from __future__ import annotations

import errno
from collections.abc import Callable
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import (
    Channel,
    Circumstances,
    HammeredStructure,
    Hammering,
    HitDecision,
    HitFlags,
    SimulatedSource,
    Structure,
    TapsEmulator,
    TapsSource,
    TapTest,
    estimate_frf,
)
from acquisition.emulation import SignalFunction
from lobewatch.logbook import Logbook
from lobewatch.tap.hit_loop import TapStopped
from lobewatch.tap.session import TapSession
from lobewatch.tap.tap_in_progress import TapInProgress, commit_cross_tap
from tests.lobewatch.conftest import Shop

RATE = 25600.0
HAMMER = Channel("force", 2.25e-3, 5.0, calibration_date="2026-01-15")
ALONG_X = Channel("acceleration", 1.02e-3, 5.0, direction="x", calibration_date="2026-01-15")
ALONG_Y = Channel("acceleration", 0.51e-3, 5.0, direction="y", calibration_date="2026-01-15")
SENSORS = HAMMER, ALONG_Y, ALONG_X
CAREFUL = Hammering(double_hits=0.0, overloads=0.0)
ANGLE = np.radians(35.0)
FREQUENCY, DAMPING, STIFFNESS = np.array([1650.0, 1780.0]), np.array([0.03, 0.03]), np.array([30e6, 33e6])
AXES = np.array([[np.cos(ANGLE), np.sin(ANGLE)], [-np.sin(ANGLE), np.cos(ANGLE)]])
"""Directions of motion of the two modes, a row each: a mode hit along a and seen along b shows u_a u_b / K."""
X, Y = 0, 1


def shown(hit: int, seen: int) -> Structure:
    return Structure(FREQUENCY, DAMPING, STIFFNESS / (AXES[:, hit] * AXES[:, seen]))


def felt(hit: int, seed: int = 1, hammering: Hammering = CAREFUL) -> SignalFunction:
    """Return force and the signals of SENSORS for hits along an axis."""
    return HammeredStructure(
        shown(hit, Y), RATE, np.random.default_rng(seed), hammering, cross_structures=(shown(hit, X),)
    )


def changed(
    signal: SignalFunction, row: int, change: Callable[[NDArray[np.float64]], NDArray[np.float64]]
) -> SignalFunction:
    def other(first: int, count: int) -> NDArray[np.float64]:
        signals = signal(first, count)
        signals[row] = change(signals[row])
        return signals

    return other


@pytest.fixture
def short(shop: Shop) -> Shop:
    """Ask for five hits and no program."""
    shop.edit("hits = 10 ", "hits = 5 ")
    shop.run()
    return shop


class Bench(SimulatedSource):
    """Sensors on a device without a cable."""

    def __init__(self, signal: SignalFunction, sensors: tuple[Channel, ...] = SENSORS) -> None:
        super().__init__(signal, sensors, RATE, round(60 * RATE))

    fault = ""

    def close(self) -> None: ...


def tap(shop: Shop, open_device: Callable[[], Any], direction: Any = "x") -> TapSession:
    about = Circumstances("m", datetime.now(UTC), "reference", direction, "", shop.folder.toml_text)
    session = TapSession(shop.folder, open_device, about, guided=False)
    session.run()
    return session


def test_ten_hits_are_a_tap_in_x_and_a_tap_across_with_signs_and_stiffness_of_the_truth(short: Shop) -> None:
    with TapsEmulator(felt(X), SENSORS, RATE, realtime=False) as device:
        session = tap(short, lambda: TapsSource(device.port))
    logbook = short.logbook
    assert [entry.direction for entry in logbook.taps] == ["x", "xy"]
    assert [entry.id for entry in logbook.taps] == session.saved
    driving, across = (short.folder.read(entry) for entry in logbook.taps)
    assert driving.circumstances.created == across.circumstances.created
    assert driving.hits[0].channels == (HAMMER, ALONG_X)
    assert across.hits[0].channels == (HAMMER, ALONG_Y)
    for hit, same in zip(driving.hits, across.hits, strict=True):
        np.testing.assert_array_equal(hit.force, same.force)
    cross = logbook.measurement(across.id).cross
    assert cross is not None
    assert [mode.frequency for mode in cross] == pytest.approx(FREQUENCY, rel=1e-3)
    truth = STIFFNESS / (AXES[:, X] * AXES[:, Y])
    assert np.sign(truth).tolist() == [1, -1]
    for mode, stiffness in zip(cross, truth, strict=True):
        assert mode.stiffness == pytest.approx(stiffness, abs=3 * mode.standard_error[2])
        assert mode.standard_error[2] < 0.05 * abs(stiffness)


def test_after_x_and_y_it_is_known_to_which_side_modes_lie_as_if_tapped_across_by_hand(short: Shop) -> None:
    tap(short, lambda: Bench(felt(X)))
    assert tap(short, lambda: Bench(felt(Y, seed=2)), "y").across is None
    tool = short.logbook.assembly("reference")
    (vectors,) = tool.principal_directions.sign_patterns
    assert vectors is not None
    first = int(np.argmin([mode.frequency for mode in tool.x or ()]))
    assert vectors[first] == pytest.approx(AXES[0], abs=0.02)
    by_hand = tap(short, lambda: Bench(felt(X)), "xy")
    assert by_hand.across is None
    ours, theirs = (short.folder.read(entry) for entry in short.logbook.series("reference", "xy"))
    np.testing.assert_allclose(ours.required_frf.receptance, theirs.required_frf.receptance, rtol=1e-9)


def still(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return 0 * values


def clipped(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(50 * values)


@pytest.mark.parametrize(
    ("fault", "reason"),
    [(still, "not judged"), (clipped, "overload (response)")],
)
def test_a_second_sensor_that_tells_nothing_costs_the_driving_point_nothing(
    fault: Callable[[NDArray[np.float64]], NDArray[np.float64]], reason: str, short: Shop
) -> None:
    session = tap(short, lambda: Bench(changed(felt(X), 1, fault)))
    assert session.across is not None
    assert session.across.tap_id is None
    assert all(fact in session.across.text for fact in ("xy", "0 of", "5 hits"))
    assert reason in session.across.text
    (entry,) = short.logbook.taps
    assert entry.direction == "x"
    assert session.measurement.followed is not None
    assert session.measurement.followed.frequency == pytest.approx(FREQUENCY[0], rel=1e-3)


def test_hits_that_only_the_second_sensor_cannot_follow_are_rejected_in_it_alone(short: Shop) -> None:
    seen = list[int]()

    def some(values: NDArray[np.float64]) -> NDArray[np.float64]:
        seen.append(values.size)
        return clipped(values) if sum(seen) < 1.0 * RATE else values

    session = tap(short, lambda: Bench(changed(felt(X), 1, some)))
    driving, across = (short.folder.read(entry) for entry in short.logbook.taps)
    assert len(driving.accepted) == 5
    assert 3 <= len(across.accepted) < 5
    assert session.across is not None
    facts = "xy", f"{len(across.accepted)} of", "5 hits", "overload (response)"
    assert all(fact in session.across.text for fact in facts)


def test_a_disk_that_is_full_for_the_tap_across_leaves_the_other(short: Shop, monkeypatch: pytest.MonkeyPatch) -> None:
    commit = Logbook.commit

    def full(logbook: Logbook, tap: TapTest, **more: Any) -> None:
        if tap.circumstances.direction == "xy":
            raise OSError(errno.ENOSPC, "No space left on device")
        commit(logbook, tap, **more)

    monkeypatch.setattr(Logbook, "commit", full)
    session = tap(short, lambda: Bench(felt(X)))
    assert session.across is not None
    assert session.across.tap_id is None
    assert all(fact in session.across.text for fact in ("xy", "No space left on device"))
    assert [entry.direction for entry in short.logbook.taps] == ["x"]


def test_an_interrupted_test_resumes_what_both_sensors_felt(short: Shop) -> None:
    about = Circumstances("m", datetime.now(UTC), "reference", "x", "", short.folder.toml_text)
    session = TapSession(short.folder, lambda: Bench(felt(X)), about, guided=False)
    session.wakes.add(lambda: session.stop() if session.state.good == 3 else None)
    with pytest.raises(TapStopped):
        session.run()
    assert list(short.logbook.taps) == []
    tap(short, lambda: Bench(felt(X, seed=3)))
    driving, across = (short.folder.read(entry) for entry in short.logbook.taps)
    assert len(driving.hits) == len(across.hits) == len(across.accepted) == 5
    for hit, same in zip(driving.hits, across.hits, strict=True):
        np.testing.assert_array_equal(hit.force, same.force)


def test_swapped_axes_are_no_driving_point(short: Shop) -> None:
    """Connect y to the input of x: the assumed driving point then has a mode of negative stiffness."""
    swapped = (HAMMER, ALONG_X, ALONG_Y)
    session = tap(short, lambda: Bench(felt(X), swapped))
    assert "no-lobes-driving-point" in {remark.code for remark in session.measurement.remarks}


def test_decisions_of_the_operator_hold_for_the_cross_tap_too(short: Shop) -> None:
    tap(short, lambda: Bench(felt(X)))
    driving, across = (short.folder.read(entry) for entry in short.logbook.taps)
    hits = [replace(hit, cross_hit=cross) for hit, cross in zip(driving.hits, across.hits, strict=True)]
    flags = [HitFlags.TOO_HARD, HitFlags.TOO_HARD, *driving.flags[2:]]
    decisions = HitDecision(2, "accept", ("too-hard",)), HitDecision(5, "reject")
    test = TapInProgress("ID", driving.circumstances, short.folder, hits, flags, decisions=decisions)
    stored: list[TapTest] = []
    assert commit_cross_tap(test, stored.append)
    (cross,) = stored
    assert cross.decisions == decisions
    assert [not found for found in cross.decided_flags] == [False, True, True, True, False]
    assert cross.required_frf.n_averages == 3
    expected = estimate_frf([across.hits[i] for i in (1, 2, 3)])
    np.testing.assert_allclose(cross.required_frf.receptance, expected.receptance, rtol=1e-12)
