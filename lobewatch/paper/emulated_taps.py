"""Tap tests of ten hits on a structure made of modes, with the noise of a hammer and a sensor."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np

from acquisition import (
    Channel,
    Frf,
    HammeredStructure,
    Hammering,
    SimulatedSource,
    Structure,
    Trigger,
    capture_hits,
    check_hit,
    estimate_frf,
)
from modal import Mode

RATE = 25600.0
"""Samples a second."""
CHANNELS = Channel("force", 2.25e-3, 5.0), Channel("acceleration", 1.02e-3, 5.0)
"""Hammer and accelerometer of the demo."""
TRIGGER = Trigger(level=20.0, n_samples=6400, pre_trigger=512)
"""Records of 0.25 s."""
SECONDS = 10.0
"""Time in which ten good hits are there."""


def emulated_taps(modes: Sequence[Mode], tests: int, hits: int = 10) -> Iterator[Frf]:
    """The FRF of each of so many tap tests, each with random numbers of its own."""
    values = np.array([(mode.frequency, mode.damping_ratio, mode.stiffness) for mode in modes])
    structure = Structure(values[:, 0], values[:, 1], values[:, 2])
    for seed in range(tests):
        signal = HammeredStructure(structure, RATE, np.random.default_rng(seed), Hammering())
        source = SimulatedSource(signal, CHANNELS, RATE, int(SECONDS * RATE))
        source.start()
        good = (hit for hit in capture_hits(source, TRIGGER) if not check_hit(hit))
        yield estimate_frf(list(islice(good, hits)))
