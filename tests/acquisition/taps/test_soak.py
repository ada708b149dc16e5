"""Ten minutes of a TAPS/1 stream with every fault at random: no wrong sample, no growing memory."""

from __future__ import annotations

import os
import random
import time
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition import Channel, DeviceError, Event, EventKind, TapsEmulator, TapsFaults, TapsSource
from acquisition.channel import Block

RATE = 51_200.0
MINUTES = 10.0
FAULTS = TapsFaults(
    drop_every=97, corrupt_every=89, duplicate_every=83, cut_every=79, noise_every=73, noise_at_start=True
)


def counted(first: int, n: int) -> NDArray[np.float64]:
    """Return a 24-bit counter and its complement, which tell each scan's index."""
    index = np.arange(first, first + n) % 2**23
    return np.stack([index, -1 - index]).astype(np.float64)


def resident_megabytes() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


@pytest.mark.long
@pytest.mark.timeout(0)
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="the memory in use is read from /proc")
def test_ten_minutes_of_faults(tmp_path: Path) -> None:
    channels = tuple(Channel(quantity, 1.0, 2.0**23, adc_bits=24) for quantity in ("force", "acceleration"))
    chance = random.Random(1)
    found: dict[str, float] = {
        "scans": 0,
        "lost": 0,
        "dropped frames": 0,
        "unpluggings": 0,
        "events": 0,
        "growth MB": 0.0,
    }
    memory = 0.0
    ends = time.monotonic() + 60 * MINUTES
    with TapsEmulator(counted, channels, RATE, link=tmp_path / "daq", faults=FAULTS) as device:
        while time.monotonic() < ends:
            with TapsSource(str(tmp_path / "daq")) as source:
                stream(device, source, min(ends, time.monotonic() + chance.uniform(1, 20)), found)
                device.unplug()
                with pytest.raises(DeviceError, match="unplugged"):
                    list(source.blocks())
                device.replug()
            found["unpluggings"] += 1
            memory = memory or resident_megabytes()
            found["growth MB"] = max(found["growth MB"], resident_megabytes() - memory)
    print(found)  # noqa: T201  (for docs/studies/long-tests.md)
    assert found["scans"] + found["lost"] > 0.8 * 60 * MINUTES * RATE
    assert found["growth MB"] < 30
    assert 0 < found["lost"] < 0.2 * found["scans"]
    assert found["events"] > 0 < found["dropped frames"]


def stream(device: TapsEmulator, source: TapsSource, until: float, found: dict[str, float]) -> None:
    """Check every sample until then."""
    source.start()
    before: Block | None = None
    offset = None
    for block in source.blocks():
        index = block.codes[0].astype(np.int64)
        assert np.array_equal(block.codes[1], -1 - index)
        offset = (index[0] - block.first_scan) % 2**23 if offset is None else offset
        right = (offset + block.first_scan + np.arange(index.size)) % 2**23
        assert np.array_equal(index, right)
        if before is not None:
            assert block.first_scan == before.first_scan + before.codes.shape[1] + block.lost_before
        before = block
        found["scans"] += index.size
        if block.lost_before and len(source.events) < 100:
            device.send_event(Event(EventKind.BUTTON))
        if time.monotonic() > until:
            break
    found["lost"] += source.lost_scans
    found["dropped frames"] += source.dropped_frames
    found["events"] += len(source.events)
    assert source.overruns == 0
    assert source.status is not None
