"""Hits whose modes change from hit to hit, from closed forms."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from acquisition import Hit, Structure

RATE = 25600.0
RECORD, PRE_TRIGGER = 12800, 128
FORCE_NOISE, RESPONSE_NOISE = 0.05, 1.0
HARD_TIP, SOFT_TIP = (2.6e-4, 3.4e-4), (5.5e-4, 7.5e-4)
"""Range of the foot width of the pulse (s). A soft tip ends the usable band at about 3.5 kHz, where the noise grows."""
Share = Callable[[int, float], float]
"""Factor on the frequencies of a hit, by its number and its peak force (N)."""


def tap_structure(
    structures: Sequence[Structure],
    seed: int,
    *,
    share: Share = lambda *_: 1.0,
    noise: float = 1.0,
    tip: tuple[float, float] = HARD_TIP,
) -> list[Hit]:
    """Return one hit on each structure with the noise of sensors, times `noise`."""
    random, hits = np.random.default_rng(seed), []
    for number, structure in enumerate(structures):
        peak, width = random.uniform(150, 350), random.uniform(*tip)
        time = (np.arange(RECORD) - PRE_TRIGGER + random.uniform()) / RATE
        force = np.where((time >= 0) & (time <= width), np.sin(np.pi * time / width) ** 4, 0.0)
        factor = share(number, peak)
        shifted = Structure(structure.frequency * factor, structure.damping_ratio, structure.stiffness)
        response = np.zeros(RECORD)
        response[time >= 0] = shifted.response(time[time >= 0], width)
        noises = noise * random.normal(size=(2, RECORD)) * np.array([[FORCE_NOISE], [RESPONSE_NOISE]])
        hits.append(Hit(peak * force + noises[0], peak * response + noises[1], RATE, PRE_TRIGGER))
    return hits


def draw_structure(seed: int) -> Structure:
    """Return one to four modes; the first is the most flexible one, with a damping ratio of 0.5 to 5 %."""
    random = np.random.default_rng([seed, 1])
    count = int(random.integers(1, 5))
    frequency = 10 ** random.uniform(np.log10(300), np.log10(3500), count)
    damping = 10 ** random.uniform(np.log10(0.005), np.log10(0.05), count)
    stiffness = 3e7 * 10 ** random.uniform(0.5, 1.5, count) * damping[0] / np.minimum(damping, damping[0])
    stiffness[0] = 3e7
    apart = np.abs(frequency / frequency[0] - 1) > 4 * np.maximum(damping, damping[0])
    apart[0] = True
    return Structure(frequency[apart], damping[apart], stiffness[apart])
