"""How the pattern of teeth is divided, one tooth period of even teeth: where teeth enter and leave, evenly between."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobes.cut import Cut
from lobes.floquet.milling_rows import MillingRows

CYCLES = 0.75
"""Cycles of the fastest mode that counts in one piece, at most: multipliers within 1e-6 of the exact ones."""
ROUGH = 1.0
"""The same where growth within 1e-4 is enough: that of draws."""
GROWTH = 1.3
"""Larger numbers are rounded up to powers of this, so that neighbouring speeds share theirs."""
QUIET = 0.1
"""A mode counts where depth times force times its largest flexibility, 1 / (2 K zeta) of a real one, is more: a loop of
less cannot sustain itself, whatever the speed."""
NONE = 1e-12
"""Segments shorter than this share of the pattern are left out."""

Floats = NDArray[np.float64]


def segment_ends(cut: Cut, depth: Floats) -> Floats:
    """Angles where the force begins, ends or bends, from a tooth's entry to where the pattern repeats, rising (rad).

    depth (c,) in m counts for helical teeth alone: they leave later at the tip's other end. Shape (c, k + 1).
    """
    turn = sum(cut.pattern)
    entries = -cut.ahead[: len(cut.pattern)]
    lag = cut.helix_lag * depth[:, np.newaxis]
    arc = np.full(lag.shape, cut.exit_angle - cut.entry_angle)
    bends = arc if cut.helix_lag == 0 else np.hstack((lag, arc, arc + lag))
    after = (bends[:, :, np.newaxis] + entries).reshape(depth.size, -1)
    edge = np.zeros((depth.size, 1))
    inside = np.hstack((edge + entries[1:], np.mod(after, turn)))
    return np.hstack((edge, np.sort(inside, axis=1), edge + turn))


def is_free(cut: Cut, ends: Floats, depth: Floats) -> NDArray[np.bool_]:
    """Whether no tooth cuts in the segments between these ends (c, k + 1), shape (c, k)."""
    reach = cut.exit_angle - cut.entry_angle + cut.helix_lag * depth[:, np.newaxis, np.newaxis]
    middle = (ends[:, :-1, np.newaxis] + ends[:, 1:, np.newaxis]) / 2
    return np.asarray(np.all(np.mod(middle + cut.ahead, 2 * np.pi) > reach, axis=-1))


def piece_numbers(rows: MillingRows, deepest: float, most: float = CYCLES) -> NDArray[np.int64]:
    """Pieces of the whole pattern of teeth that each row needs for depths (m) up to `deepest`, shape (r,).

    most: cycles of the fastest mode that counts in one.
    """
    loop = deepest * rows.force[:, np.newaxis] / (2 * rows.stiffness * rows.damping_ratio) * np.hypot(*rows.seen)
    loop = loop * np.sum(rows.vector**2, axis=-1)
    fastest = np.maximum(np.max(np.where(loop > QUIET, rows.frequency, 0.0), axis=1), np.min(rows.frequency, axis=1))
    cycles = fastest / (2 * np.pi) * rows.period
    return np.asarray(np.ceil(np.maximum(cycles / most, 1.0)), dtype=np.int64)


def segment_pieces(cut: Cut, number: NDArray[np.int64], ends: Floats) -> NDArray[np.int64]:
    """Pieces of each segment (c, k) where the whole pattern is to have these numbers (c,); 0 for an empty one.

    None is longer than the shortest delay: what was cut before must be known.
    """
    share = np.diff(ends, axis=1) / ends[:, -1:]
    wanted = np.maximum(number[:, np.newaxis] * share, np.maximum(share * sum(cut.pattern) / cut.delays[0], 1.0))
    power = np.ceil(np.log(wanted) / np.log(GROWTH) - 1e-9)
    rounded = np.where(wanted <= 4, np.ceil(wanted - 1e-9), np.ceil(GROWTH**power - 1e-9))
    return np.where(share > NONE, rounded, 0).astype(np.int64)
