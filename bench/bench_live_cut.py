"""CPU time of the live search for cuts, as a share of the time of the stream.

.venv/bin/python bench/bench_live_cut.py
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from acquisition import Block, Channel
from lobewatch.tap.cut_recording import record_cuts

RATE, SECONDS, SCANS, TURN = 25600.0, 120, 256, 0.005
"""Sample rate (Hz), length of the stream (s), scans of a block, and time of a turn (s)."""
AIR, CUT = 5.0, 3.0
"""Length of each air and each cut (s)."""


def stream(axes: int, has_cuts: bool) -> Any:
    """Return a device that sends air and cuts in turn, as fast as it is read."""
    random, channels = np.random.default_rng(0), (Channel("acceleration", 1e-2, 5.0),) * axes
    moment = np.arange(round(SECONDS * RATE)) / RATE
    comb = sum(5.0 * np.sin(2 * np.pi * 800.0 * k * moment) for k in range(1, 7))
    signal = random.normal(scale=0.05, size=moment.size) + has_cuts * (moment % (AIR + CUT) > AIR) * comb
    codes: NDArray[np.int32] = np.stack([channels[0].encode(signal)] * axes)

    def blocks() -> Iterator[Block]:
        for first in range(0, moment.size, SCANS):
            yield Block(first, codes[:, first : first + SCANS])

    return SimpleNamespace(channels=channels, sample_rate=RATE, blocks=blocks, events=deque())


def main() -> None:
    """Print the table."""
    print("| axes | stream | cuts | CPU / time of the stream (%) |\n|---|---|---|---|")
    for axes in (1, 3):
        for has_cuts in (False, True):
            device = stream(axes, has_cuts)
            begun, count = time.process_time(), 0
            try:
                count = sum(1 for _ in record_cuts(device, TURN, 2.0 * SECONDS, lambda _: None))
            except ValueError:  # no cut
                count = 0
            share = 100 * (time.process_time() - begun) / SECONDS
            print(f"| {axes} | {'cuts' if has_cuts else 'air'} | {count} | {share:.1f} |", flush=True)


if __name__ == "__main__":
    with threadpool_limits(1):
        main()
