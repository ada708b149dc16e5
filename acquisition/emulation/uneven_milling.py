"""Milling with teeth unevenly spaced, stepped through time: each tooth meets what the one before it has left.

As `acquisition.emulation.milling`, one cut at a time. A turn has a whole number of steps, and every pitch nearly so;
the surface is kept by its angle, not by its time.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from acquisition.emulation.milling_cut import MillingCut, Passage
from acquisition.emulation.milling_tables import ModeTables, ToothTables, steps_needed, tables

Floats = NDArray[np.float64]

MORE_STEPS = 1.25
"""Steps of a turn are up to this many times those needed, where pitches then are more nearly whole numbers of them."""


def turn_tables(cut: MillingCut) -> tuple[ModeTables, ToothTables]:
    """Tables of one tooth over a turn."""
    needed = steps_needed(cut) * cut.teeth
    number = np.arange(needed, math.ceil(MORE_STEPS * needed) + 1)
    steps = number[:, np.newaxis] * np.array(cut.pitch) / (2 * np.pi)
    off = np.max(np.abs(steps - np.rint(steps)), axis=1) / number
    single = replace(cut, teeth=1, pitch=(), runout=())
    return tables([single], int(number[np.argmin(np.round(off, 9))]))


def uneven_cutting(
    cut: MillingCut, modes: ModeTables, tooth: ToothTables, passage: Passage
) -> tuple[NDArray[np.complex128], Floats, NDArray[np.complex128]]:
    """How modes swing after each step from first to last contact, what they gained in it (n, 1, m), and the last."""
    cells, step = len(tooth.root), float(modes.step[0])
    behind = np.rint(np.cumsum((0.0, *cut.pitch[1:])) * cells / (2 * np.pi)).astype(np.int64)
    share = np.array(cut.pitch) * cut.teeth / (2 * np.pi)
    stands_out = np.array(cut.runout or np.zeros(cut.teeth))
    thick, root, reach, push, rub = (
        part[:, 0] for part in (tooth.thick, tooth.root, tooth.reach, tooth.push, tooth.rub)
    )
    number = math.ceil(passage.cutting / step)
    depth = passage.depth_at(np.asarray((np.arange(number) + 0.5) * step))
    surface, swing = np.zeros_like(thick), np.zeros(modes.flight.shape[1], dtype=complex)
    swings, gains = np.empty((number, swing.size), dtype=complex), np.empty((number, swing.size))
    for n in range(number):
        at = (n - behind) % cells
        swing = swing * modes.flight[0]
        feed = thick[at] * share[:, np.newaxis]
        chip = feed + root[at] * stands_out[:, np.newaxis] + reach[at] @ swing.imag - surface[at]
        np.maximum(chip, 0.0, out=chip)
        surface[at] += chip - feed
        gains[n] = depth[n] * (np.einsum("jme,je->m", push[at], chip) + np.sum(rub[at], axis=0))
        swing = swing + gains[n]
        swings[n] = swing
    return swings[:, np.newaxis], gains[:, np.newaxis], swing
