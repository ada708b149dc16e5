"""The trigger: crossings, hysteresis, real pre-trigger samples, whatever the blocks are."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from acquisition import Block, Channel, DataError, HammeredStructure, HitSearch, SimulatedSource, Trigger, capture_hits

RATE = 1000.0
UNIT = (Channel("force", 1.0, 32768.0), Channel("acceleration", 1.0, 32768.0))
TRIGGER = Trigger(level=100.0, n_samples=50, pre_trigger=10)


class Recorded:
    """A source that plays back force samples, with gaps."""

    sample_rate = RATE

    def __init__(
        self,
        force: NDArray[np.int32],
        block: int = 7,
        gaps: tuple[int, ...] = (),
        channels: tuple[Channel, ...] = UNIT,
        overloads: dict[int, int] | None = None,
    ) -> None:
        self.channels = channels
        self._codes = np.stack([force, np.arange(force.size, dtype=np.int32)])
        self._block, self._gaps, self._overloads = block, gaps, overloads or {}

    def start(self) -> None: ...

    def stop(self) -> None: ...

    def blocks(self) -> Iterator[Block]:
        for first in range(0, self._codes.shape[1], self._block):
            lost = 5 if first in self._gaps else 0
            overload = self._overloads.get(first, 0)
            yield Block(first, self._codes[:, first : first + self._block], overload, lost)


class Ringing(Recorded):
    """Hits and their decaying response, on top of noise of 1 code rms."""

    def __init__(
        self,
        force: NDArray[np.int32],
        *starts: int,
        level: float = 1000.0,
        tau: float = 40.0,
        vibration: NDArray[np.float64] | float = 0.0,
    ) -> None:
        super().__init__(force)
        time = np.arange(force.size)
        response = np.random.default_rng(1).normal(size=force.size) + vibration
        for start in starts:
            since = np.maximum(time - start, 0)
            response += (time >= start) * level * np.exp(-since / tau) * np.cos(0.9 * since)
        self._codes[1] = np.rint(response)


def force(*hits: int, n: int = 400, shape: tuple[int, ...] = (30, 70, 150, 300, 150, 40)) -> NDArray[np.int32]:
    signal = np.zeros(n, np.int32)
    for at in hits:
        signal[at : at + len(shape)] = shape
    return signal


@settings(max_examples=50)
@given(st.integers(1, 60), st.integers(15, 100), st.integers(70, 200))
def test_hits_are_cut_at_the_crossing_whatever_the_blocks(block: int, first: int, gap: int) -> None:
    hits = list(capture_hits(Recorded(force(first, first + gap), block), TRIGGER))
    assert [int(hit.acceleration[0]) for hit in hits] == [first + 2 - 10, first + gap + 2 - 10]
    assert all(hit.force.size == 50 and hit.pre_trigger == 10 and hit.force[10] == 150 for hit in hits)


def test_a_hit_without_enough_real_samples_before_it_is_skipped() -> None:
    assert [int(hit.acceleration[0]) for hit in capture_hits(Recorded(force(5, 200)), TRIGGER)] == [192]


def test_a_signal_that_hangs_between_the_levels_does_not_arm_the_trigger() -> None:
    signal = force(200)
    signal[100:199] = 60
    assert list(capture_hits(Recorded(signal), TRIGGER)) == []


def test_below_the_level_nothing_happens_and_an_offset_is_no_hit() -> None:
    assert list(capture_hits(Recorded(force(100, shape=(40, 99, 40))), TRIGGER)) == []
    assert list(capture_hits(Recorded(np.full(4000, 60, np.int32)), TRIGGER)) == []


@pytest.mark.parametrize(("gap_at", "lost"), [(98, 0), (105, 5), (147, 5), (154, 0)])
def test_a_gap_counts_for_the_hit_that_it_touches_only(gap_at: int, lost: int) -> None:
    (hit,) = capture_hits(Recorded(force(106), 7, (gap_at,)), TRIGGER)
    assert hit.lost_scans == lost


@pytest.mark.parametrize(
    ("reported", "overload"),
    [({91: 1}, 0), ({98: 1}, 1), ({105: 1, 140: 2}, 3), ({147: 4}, 0), ({147: 2}, 2), ({154: 3}, 0)],
)
def test_an_overload_counts_for_the_hit_that_it_touches_only(reported: dict[int, int], overload: int) -> None:
    (hit,) = capture_hits(Recorded(force(110), 7, overloads=reported), TRIGGER)  # the record is 102 to 151
    assert hit.overload == overload


def test_a_hammer_of_negative_sensitivity_triggers_too() -> None:
    wired = (Channel("force", -1.0, 32768.0), UNIT[1])
    (hit,) = capture_hits(Recorded(-force(100), channels=wired), TRIGGER)
    assert hit.force[10] == 150
    assert np.max(hit.force) == 300


def test_simulated_hits_start_at_the_trigger(
    tapper: Callable[..., HammeredStructure], channels: tuple[Channel, Channel]
) -> None:
    source = SimulatedSource(tapper(), channels, 25600.0, 80_000)
    source.start()
    hits = list(capture_hits(source, Trigger(20.0, 6400, 512)))
    assert len(hits) >= 5
    for hit in hits:
        assert np.max(hit.force[:512]) < 20 <= hit.force[512]
        assert hit.time[512] == 0


@pytest.mark.parametrize("quantities", [("force", "force"), ("acceleration", "acceleration"), ("force",)])
def test_one_force_and_one_acceleration_channel_are_needed(quantities: tuple[str, ...]) -> None:
    channels = tuple(Channel(quantity, 1.0, 5.0) for quantity in quantities)  # type: ignore[arg-type]
    with pytest.raises(DataError, match="force and one acceleration"):
        list(capture_hits(Recorded(force(100), channels=channels), TRIGGER))


def test_swapped_inputs_are_detected_by_what_they_measure() -> None:
    (hit,) = capture_hits(_Swapped(), TRIGGER)
    assert np.max(hit.force) == 300


class _Swapped(Recorded):
    def __init__(self) -> None:
        super().__init__(force(100), channels=(UNIT[1], UNIT[0]))
        self._codes = self._codes[::-1]


@pytest.mark.parametrize(("level", "n", "before"), [(0.0, 50, 10), (np.nan, 50, 10), (1.0, 50, 50), (1.0, 50, 0)])
def test_a_trigger_that_cannot_work_is_rejected(level: float, n: int, before: int) -> None:
    with pytest.raises(ValueError, match=r"trigger level|pre_trigger"):
        Trigger(level, n, before)


RESTING = Trigger(level=100.0, n_samples=50, pre_trigger=10, rest_rms=1.0)


def searched(source: Recorded, trigger: Trigger = RESTING) -> tuple[list[float], HitSearch, list[bool]]:
    """Return the times of the hits, the search, and whether it was armed after each block."""
    search = HitSearch(source.channels, RATE, trigger)
    hits, armed = [], []
    for block in source.blocks():
        hits += list(search.feed(block))
        armed.append(search.armed)
    return [float(np.sum(hit.force)) for hit in hits], search, armed


def test_a_hit_while_the_structure_rings_is_skipped_and_reported() -> None:
    signal = force(100, 250, 600, n=1000)
    source = Ringing(signal, 102, 252, 602)
    assert len(searched(source, TRIGGER)[0]) == 3
    hits, search, armed = searched(source)
    assert len(hits) == 2
    assert search.too_early == 1
    at = [100 // 7, 250 // 7, 560 // 7, 990 // 7]
    assert [armed[i - 1] for i in at] == [True, False, True, True]


def test_a_hit_on_a_structure_that_was_moved_after_arming_is_skipped() -> None:
    hits, search, _ = searched(Ringing(force(300, 700, n=1000), 250, level=50.0, tau=100.0))
    assert len(hits) == 1
    assert search.too_early == 1


def test_a_new_baseline_is_learnt_where_nothing_falls() -> None:
    signal = force(1500, 5000, n=5500)
    time = np.arange(5500)
    vibration = np.where(time > 1600, 50 * np.sin(0.7 * time), 0.0)
    hits, search, armed = searched(Ringing(signal, 1502, 5002, vibration=vibration))
    assert len(hits) == 2
    assert not armed[3000 // 7]
    assert armed[4500 // 7]
    assert search.too_early == 0


def test_slow_ringing_is_no_new_baseline() -> None:
    _, _, armed = searched(Ringing(force(500, n=6000), 502, level=10_000.0, tau=2000.0))
    assert not any(armed[600 // 7 : 5900 // 7])


def test_a_quiet_converter_at_rest_may_move_by_its_steps() -> None:
    source = Ringing(force(100, 300))
    assert len(searched(source, Trigger(100.0, 50, 10, rest_rms=0.0))[0]) == 2
