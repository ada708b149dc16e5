"""Hits detected from the acceleration only."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Channel, DataError, SimulatedSource, Trigger, capture_hits
from acquisition.hit import TapInputs

RATE = 12800.0
SENSOR = Channel("acceleration", 1e-2, 5.0)
HAMMER = Channel("force", 1e-2, 5.0)
BEGINS = (4000, 16000, 30000)


def signal(first: int, count: int) -> NDArray[np.float64]:
    """Decays that rise over two half waves, over gravity and noise."""
    time = (first + np.arange(count))[:, None] - np.array(BEGINS)
    decay = np.where(time >= 0, np.exp(-np.maximum(time, 0) / 400) * np.minimum(time / 8, 1), 0)
    noise = np.random.default_rng(first).normal(scale=0.5, size=count)
    return np.asarray(9.81 + noise + np.sum(200 * decay * np.sin(2 * np.pi * time / 12), axis=1))[None]


def hits_at(channel: Channel, **trigger: float) -> list[int]:
    source = SimulatedSource(signal, (channel,), RATE, 40000, block=300)
    level = Trigger(50.0, 4000, 256, quantity="acceleration", offset=9.81, **trigger)
    found = list(capture_hits(source, level))
    assert all(not hit.has_force and hit.acceleration.size == 4000 for hit in found)
    return [int(np.argmax(np.abs(hit.acceleration - 9.81) > 20)) for hit in found]


@pytest.mark.parametrize("sign", [1, -1])
def test_each_decay_is_one_hit_with_its_pre_trigger(sign: int) -> None:
    channel = Channel("acceleration", sign * 1e-2, 5.0)
    starts = hits_at(channel)
    assert len(starts) == len(BEGINS)
    assert all(230 < start <= 256 for start in starts)
    assert len(hits_at(channel, rest_rms=0.5)) == len(BEGINS)


def test_a_level_that_gravity_alone_reaches_counts_from_rest() -> None:
    source = SimulatedSource(signal, (SENSOR,), RATE, 3000)
    below = Trigger(5.0, 1000, 256, quantity="acceleration", offset=9.81)
    assert list(capture_hits(source, below)) == []


def test_of_several_accelerations_that_of_the_direction_is_taken() -> None:
    x, y = (Channel("acceleration", 1e-2, 5.0, direction=name) for name in ("x", "y"))
    axes = (x, y, SENSOR)
    assert TapInputs.select(axes, "acceleration", "x").rows == (0,)
    assert TapInputs.select((HAMMER, *axes), "force", "y").rows == (0, 2)
    assert TapInputs.select((HAMMER, *axes), "force", "xy").rows == (0, 2)  # hit in x, seen in y
    with pytest.raises(DataError, match=r'acceleration x, acceleration y, acceleration\. .* direction = "x"'):
        TapInputs.select(axes, "acceleration")
    with pytest.raises(DataError, match='direction = "y"'):
        TapInputs.select((x, SENSOR), "acceleration", "y")


def test_the_force_is_left_out_where_the_response_triggers() -> None:
    assert TapInputs.select((HAMMER, SENSOR), "acceleration").rows == (1,)
    with pytest.raises(DataError, match=r"for force\. .*one acceleration"):
        TapInputs.select((HAMMER,), "acceleration")
    with pytest.raises(DataError, match="one force and one acceleration"):
        TapInputs.select((SENSOR,))
