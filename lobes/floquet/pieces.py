"""How the tooth period is divided: at the angles where teeth enter and leave, and evenly between them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lobes.cut import Cut
from lobes.floquet.milling_rows import MillingRows

CYCLES = 0.75
"""Cycles of the fastest mode that counts in one piece, at most: multipliers within 1e-6 of the exact ones."""
GROWTH = 1.3
"""Larger numbers are rounded up to powers of this, so that neighbouring speeds share theirs."""
QUIET = 0.1
"""A mode counts where depth times force times its largest flexibility, 1 / (2 K zeta) of a real one, is more: a loop of
less cannot sustain itself, whatever the speed."""
NONE = 1e-12
"""Segments shorter than this share of the tooth period are left out."""

Floats = NDArray[np.float64]


def segment_ends(cut: Cut, depth: Floats) -> Floats:
    """Angles where the force begins, ends or bends, from the entry of a tooth to that of the next (rad), rising.

    depth (c,) in m counts for helical teeth alone: they leave later at the tip's other end. Shape (c, k + 1).
    """
    pitch = 2 * np.pi / cut.teeth
    lag = cut.helix_lag * depth[:, np.newaxis]
    arc = np.full(lag.shape, cut.exit_angle - cut.entry_angle)
    bends = arc if cut.helix_lag == 0 else np.hstack((lag, arc, arc + lag))
    edge = np.zeros((depth.size, 1))
    return np.hstack((edge, np.sort(np.mod(bends, pitch), axis=1), edge + pitch))


def is_free(cut: Cut, ends: Floats, depth: Floats) -> NDArray[np.bool_]:
    """Whether no tooth cuts in the segments between these ends (c, k + 1), shape (c, k)."""
    pitch = 2 * np.pi / cut.teeth
    reach = cut.exit_angle - cut.entry_angle + cut.helix_lag * depth[:, np.newaxis]
    return np.asarray((ends[:, :-1] + ends[:, 1:]) / 2 > reach) & (reach < pitch)


def piece_numbers(rows: MillingRows, deepest: float) -> NDArray[np.int64]:
    """Pieces of a whole tooth period that each row needs for depths (m) up to `deepest`, shape (r,)."""
    loop = deepest * rows.force[:, np.newaxis] / (2 * rows.stiffness * rows.damping_ratio) * np.hypot(*rows.seen)
    fastest = np.maximum(np.max(np.where(loop > QUIET, rows.frequency, 0.0), axis=1), np.min(rows.frequency, axis=1))
    cycles = fastest / (2 * np.pi) * rows.tooth_period
    return np.asarray(np.ceil(np.maximum(cycles / CYCLES, 1.0)), dtype=np.int64)


def segment_pieces(number: NDArray[np.int64], ends: Floats) -> NDArray[np.int64]:
    """Pieces of each segment (c, k) where the whole tooth period is to have these numbers (c,); 0 for an empty one."""
    share = np.diff(ends, axis=1) / ends[:, -1:]
    wanted = np.maximum(number[:, np.newaxis] * share, 1.0)
    power = np.ceil(np.log(wanted) / np.log(GROWTH) - 1e-9)
    rounded = np.where(wanted <= 4, np.ceil(wanted - 1e-9), np.ceil(GROWTH**power - 1e-9))
    return np.where(share > NONE, rounded, 0).astype(np.int64)
