"""What cuts that are stepped together look like at each step of a tooth period."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition.emulation.hammered_structure import Structure
from acquisition.emulation.milling_cut import MillingCut

Floats = NDArray[np.float64]

CYCLE, PERIOD, ARC = 16, 30, 16
"""Fewest steps in a cycle of the fastest mode (as stiffened by the cut), in a tooth period, and in the arc of cut."""
LEAST_RATE = 60e3
"""Fewest steps a second: a device without a filter hears what is above half its sample rate, too."""
LAG = 0.15
"""Largest lag between two slices of a helical tooth (rad)."""


def steps_needed(cut: MillingCut) -> int:
    """Steps a tooth period that a cut needs."""
    pitch, arc = 2 * np.pi / cut.teeth, cut.exit_angle - cut.entry_angle
    cutting = cut.depth * math.hypot(cut.tangential, cut.radial) * math.ceil(arc / pitch)
    sides = [side for side in (cut.x, cut.y) if side is not None]
    fastest = max(float(np.max(side.frequency * np.sqrt(1 + cutting / side.stiffness))) for side in sides)
    rate = max(CYCLE * fastest, LEAST_RATE)
    return math.ceil(max(rate * cut.tooth_period, PERIOD, ARC * pitch / arc))


@dataclass(frozen=True, eq=False)
class ModeTables:
    """Modes m of cuts c: a real mode swings as z = (q' + zeta w q) / w_d + i q, so that free flight is a factor."""

    pole: NDArray[np.complex128]
    """-zeta w + i w_d (rad/s), shape (c, m); 0 where a cut has fewer modes."""
    flight: NDArray[np.complex128]
    """Factor of z over a step, shape (c, m)."""
    axis: Floats
    """Motion of the tip along x and y of the machine by each mode, shape (c, 2, m)."""
    step: Floats
    """Length of a step (s), shape (c,)."""


@dataclass(frozen=True, eq=False)
class ToothTables:
    """Teeth (and slices of helical ones) e that are in the cut at each step s, of cuts c.

    Chip and force carry one root of the share of a step and of the depth in which the tooth cuts.
    """

    root: Floats
    """Root of that share, shape (s, c, e); 0 where fewer are in the cut."""
    thick: Floats
    """Chip of a rigid tool (m), shape (s, c, e)."""
    place: NDArray[np.int64]
    """Number of the pitch after angle 0 that the tooth is in, shape (s, c, e)."""
    reach: Floats
    """Reach of a tooth further into the part by each mode's displacement, shape (s, c, e, m)."""
    push: Floats
    """Gain of z.real in a step from each chip at full depth, shape (s, c, m, e)."""
    rub: Floats
    """Gain of z.real in a step from all edges in the cut, shape (s, c, m)."""


def tables(cuts: Sequence[MillingCut], steps: int) -> tuple[ModeTables, ToothTables]:
    """Tables of cuts with `steps` steps a tooth period."""
    pole, axis, shape, kick, rub = _side_by_side([_modes(cut, cut.tooth_period / steps) for cut in cuts], 0)
    root, place, normal = _side_by_side([_in_cut(cut, steps) for cut in cuts], 1)
    step = np.array([cut.tooth_period / steps for cut in cuts])
    thick = normal[:, :, 0] * np.array([[cut.feed_per_tooth] for cut in cuts])
    reach = np.swapaxes(normal, -1, -2) @ shape
    push = np.swapaxes(kick, -1, -2) @ normal
    edges = np.swapaxes(rub, -1, -2) @ np.sum(normal * root[:, :, np.newaxis], axis=-1, keepdims=True)
    modes = ModeTables(pole, np.exp(pole * step[:, np.newaxis]), axis, step)
    return modes, ToothTables(root, thick, place, reach, push, edges[..., 0])


def _side_by_side(of_cuts: Sequence[tuple[NDArray[Any], ...]], axis: int) -> list[Any]:
    """Arrays of each cut side by side along a new axis, zeros where others have more along the last one."""
    most = max(arrays[0].shape[-1] for arrays in of_cuts)
    return [
        np.stack([np.pad(a, [(0, 0)] * (a.ndim - 1) + [(0, most - a.shape[-1])]) for a in same], axis=axis)
        for same in zip(*of_cuts, strict=True)
    ]


def _modes(cut: MillingCut, step: float) -> tuple[NDArray[Any], ...]:
    """Pole (m,); along x and y, along feed and normal, gain of z.real from chips, from edges, each (2, m)."""
    rigid = Structure(np.empty(0), np.empty(0), np.empty(0))
    x, y = cut.x or rigid, cut.y or rigid
    w = 2 * np.pi * np.concatenate([x.frequency, y.frequency])
    zeta, k = np.concatenate([x.damping_ratio, y.damping_ratio]), np.concatenate([x.stiffness, y.stiffness])
    damped = w * np.sqrt(1 - zeta**2)
    axis = np.repeat(np.eye(2), [x.frequency.size, y.frequency.size], axis=1)
    c, s = math.cos(cut.feed_angle), math.sin(cut.feed_angle)
    shape = np.array([[c, s], [-s, c]]) @ axis
    kick, rub = (
        -cut.depth * np.array([[radial, -tangential], [tangential, radial]]) @ shape * step * w**2 / (k * damped)
        for tangential, radial in ((cut.tangential, cut.radial), (cut.tangential_edge, cut.radial_edge))
    )
    return -zeta * w + 1j * damped, axis, shape, kick, rub


def _in_cut(cut: MillingCut, steps: int) -> tuple[NDArray[Any], ...]:
    """Root of the share and place (s, e), outward normal along the feed and its normal times the root (s, 2, e)."""
    slices = max(1, math.ceil(cut.helix_lag * cut.depth / LAG))
    lag = cut.helix_lag * cut.depth * (np.arange(slices) + 0.5) / slices
    step = 2 * np.pi / (cut.teeth * steps)
    place, late = (grid.ravel() for grid in np.meshgrid(np.arange(cut.teeth), lag, indexing="ij"))
    first = np.mod(step * (np.arange(steps)[:, np.newaxis] + steps * place) - late + step, 2 * np.pi) - step
    begin, end = np.maximum(first, cut.entry_angle), np.minimum(first + step, cut.exit_angle)
    share = np.maximum(end - begin, 0) / (step * slices)
    most = max(1, int(np.max(np.count_nonzero(share, axis=1))))
    inside = np.argsort(share == 0, axis=1, kind="stable")[:, :most]
    root = np.sqrt(np.take_along_axis(share, inside, 1))
    angle = np.take_along_axis((begin + end) / 2, inside, 1)
    return root, place[inside], np.stack([np.sin(angle), np.cos(angle)], axis=1) * root[:, np.newaxis]
